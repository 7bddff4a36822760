"""Whatever comes off the network, the incident goes on, and counts what it cannot take."""

from __future__ import annotations

import msgspec
from hypothesis import given, settings
from hypothesis import strategies as st

from command_post.fusion.settings import FusionSettings
from command_post.incident import Incident, IncidentSettings
from shared.codec import encode
from shared.messages import (
    DapInstallation,
    LocalPosition,
    Message,
    OdometryIncrement,
    ProximityEvent,
    TrackStart,
)
from shared.topics import ROLES, TOPICS
from tests.stride_world import installation, proximity, stride, track_start

SMALL = IncidentSettings(fusion=FusionSettings(particles=10))
TIMES = st.integers(0, 2**63 - 1)

ids = st.sampled_from(["r1", "r2", "dap1"])
plain_keys = st.builds(
    "clew/v1/exercise/{}/{}/{}".format, st.sampled_from(ROLES), ids, st.sampled_from([*TOPICS, "x"])
)
keys = st.one_of(st.text(max_size=60), plain_keys)
words = st.text(max_size=9)
values = st.recursive(
    st.none() | st.booleans() | st.integers(-(2**63), 2**64 - 1) | st.floats() | words,
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(words, inner, max_size=4),
    max_leaves=12,
)
templates = st.sampled_from([
    track_start(0.0), stride(1.0, 1.0, 0.0), proximity(1.0, "r1"), installation(1.0, "r1"),
])  # fmt: skip


@st.composite
def bent_messages(draw: st.DrawFn) -> bytes:
    """Return a true message with one of its fields replaced by anything."""
    fields = msgspec.to_builtins(draw(templates))
    fields[draw(st.sampled_from(sorted(fields)))] = draw(values)
    return msgspec.msgpack.encode(fields)


payloads = st.one_of(st.binary(max_size=200), bent_messages())


@given(st.lists(st.tuples(keys, payloads, TIMES), max_size=25))
@settings(deadline=None)
def test_no_bytes_stop_the_incident(heard: list[tuple[str, bytes, int]]) -> None:
    incident = Incident(SMALL)
    for key, payload, now_ns in heard:
        incident.handle(key, payload, now_ns)
    incident.finish(0)
    assert incident.refusals.total() <= len(heard)
    told = [(notice.reason, notice.node_id) for notice in incident.take_notices()]
    assert len(told) == len(set(told))
    assert set(told) >= incident.refusals.keys()


@given(st.lists(st.binary(max_size=100), max_size=20))
@settings(deadline=None)
def test_garbage_is_counted_to_the_last_message(payloads: list[bytes]) -> None:
    incident = Incident(SMALL)
    for payload in payloads:
        # A byte that MessagePack never uses: no such payload can be a message by luck.
        incident.handle("clew/v1/exercise/responder/r1/truth", b"\xc1" + payload, 0)
    assert incident.refusals.total() == len(payloads)


COVARIANCE = st.floats(-1e12, 1e12)
DISPLACEMENT = st.floats(-100.0, 100.0)
ANGLE = st.floats(-1e4, 1e4)
SEQUENCE = st.integers(0, 2**63 - 1)

increments = st.builds(
    OdometryIncrement,
    event_time_ns=TIMES, sequence=SEQUENCE, start_time_ns=TIMES,
    d_north_m=DISPLACEMENT, d_east_m=DISPLACEMENT, d_down_m=DISPLACEMENT,
    d_heading_rad=ANGLE, heading_rad=ANGLE,
    covariance=st.tuples(*[COVARIANCE] * 10), mount=st.just("boot"),
)  # fmt: skip
placings = st.builds(
    LocalPosition,
    north_m=st.floats(-1e6, 1e6), east_m=st.floats(-1e6, 1e6), down_m=st.floats(-1e6, 1e6),
    covariance_m2=st.tuples(*[COVARIANCE] * 3),
)  # fmt: skip
starts = st.builds(
    TrackStart,
    event_time_ns=TIMES, sequence=SEQUENCE, position=st.none() | placings,
    heading_sd_rad=st.floats(0.0, 1e6), mount=st.just("boot"), method=st.just("zupt"),
)  # fmt: skip
proximities = st.builds(
    ProximityEvent,
    event_time_ns=TIMES, sequence=SEQUENCE, responder_id=ids,
    phase=st.sampled_from(["entered", "near", "left"]), rssi_mean_dbm=st.just(-40.0),
    rssi_variance_db2=st.just(1.0), sample_count=st.just(9),
)  # fmt: skip
installations = st.builds(
    DapInstallation,
    event_time_ns=TIMES, sequence=SEQUENCE, installer_id=st.none() | ids,
    position=st.none() | placings,
)  # fmt: skip
messages = st.one_of(
    st.tuples(st.sampled_from(["responder/r1", "responder/r2"]), st.one_of(increments, starts)),
    st.tuples(st.sampled_from(["dap/dap1", "dap/dap2"]), st.one_of(proximities, installations)),
)


@given(st.lists(st.tuples(messages, TIMES), max_size=25))
@settings(deadline=None)
def test_any_valid_messages_make_valid_messages(
    heard: list[tuple[tuple[str, Message], int]],
) -> None:
    incident = Incident(SMALL)
    topics = {topic.message: name for name, topic in TOPICS.items()}
    made = []
    for (node, message), now_ns in heard:
        key = f"clew/v1/exercise/{node}/{topics[type(message)]}"
        made += incident.handle(key, encode(message), now_ns)
    made += incident.finish(0)
    assert not incident.refusals
    for key, payload in made:
        msgspec.msgpack.decode(payload, type=TOPICS[key.rpartition("/")[2]].message)
