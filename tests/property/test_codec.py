"""The boundary where bytes become messages: everything valid passes, nothing else does."""

from __future__ import annotations

from collections.abc import Iterator
from functools import reduce
from operator import getitem
from typing import Any

import msgpack
import msgspec
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from shared.codec import MAX_PAYLOAD_BYTES, Refusal, decode, encode, parse_key
from shared.messages import Message, OdometryIncrement
from shared.topics import ROLES, TOPIC_OF, TOPICS, Key
from tests.wire_messages import INCIDENT, NODE, key_for, messages

every_topic = pytest.mark.parametrize("topic", list(TOPICS))
few = settings(max_examples=10)
"""Of each topic: there are many, and much is alike in all."""

some = settings(max_examples=20)
"""Of each topic, where any field may be the one."""

MAY_BE_ABSENT = {
    "proximity": {"near_log_odds", "range_m", "range_sd_m"},
    "installation": {"at_rest"},
    "state": {"worry"},
}
"""Fields that are not written where they hold nothing."""

WIRE_FIELDS = {
    "start": "event_time_ns sequence position heading_sd_rad mount method",
    "increment": "event_time_ns sequence start_time_ns d_north_m d_east_m d_down_m d_heading_rad "
    "heading_rad covariance mount activity activity_confidence facing_sd_rad",
    "alarm": "event_time_ns sequence kind phase confidence reason",
    "mayday": "event_time_ns sequence phase called_ns reason",
    "site": "event_time_ns sequence responder_id reason",
    "mayday_answer": "event_time_ns sequence responder_id called_ns phase stage by",
    "health": "event_time_ns sequence level findings",
    "advice": "event_time_ns sequence urgency reason boxes_left",
    "imu": "event_time_ns sequence time_ns force_m_s2 rate_rad_s field_ut "
    "pressure_pa pressure_rows",
    "rssi": "event_time_ns sequence responder_id rssi_dbm",
    "proximity": "event_time_ns sequence responder_id phase rssi_mean_dbm rssi_variance_db2 "
    "sample_count near_log_odds range_m range_sd_m",
    "peak": "event_time_ns sequence responder_id peak_dbm width_s sample_count",
    "dap_rssi": "event_time_ns sequence dap_id rssi_dbm",
    "dap_peak": "event_time_ns sequence dap_id peak_dbm width_s sample_count",
    "neighbour": "event_time_ns sequence dap_id rssi_mean_dbm rssi_variance_db2 sample_count",
    "contact": "event_time_ns sequence other_id peak_dbm width_s sample_count",
    "fix": "event_time_ns sequence responder_id source position",
    "height_fix": "event_time_ns sequence node node_id down_m sd_m",
    "installation": "event_time_ns sequence installer_id position at_rest",
    "state": "event_time_ns sequence battery_share temperature_c going worry",
    "set_down": "event_time_ns sequence dap_id position",
    "stations": "event_time_ns sequence responders daps",
    "track": "event_time_ns sequence responder_id north_m east_m down_m covariance_m2 heading_rad "
    "heading_sd_rad last_proximity_time_ns down_sd_m regions_m floors status reason",
    "dap_place": "event_time_ns sequence dap_id position",
    "beat": "event_time_ns sequence run last_number kept_from acknowledged clock lost "
    "supplies leaves followed_until_ns",
    "receipt": "event_time_ns sequence safe",
    "order": "event_time_ns sequence kind to text said_ns",
    "order_request": "event_time_ns sequence kind to text",
    "alert": "event_time_ns sequence number kind role node_id since_ns stage words by assigned_to",
    "alert_request": "event_time_ns sequence number stage assigned_to",
    "origin": "event_time_ns sequence latitude_deg longitude_deg height_m bearing_deg",
    "outside": "event_time_ns sequence kind uid callsign words position",
    "stranger": "event_time_ns sequence role node_id words",
    "order_answer": "event_time_ns sequence commander_id request_sequence refusal waited_for",
    "order_reply": "event_time_ns sequence post_id order_sequence stage",
    "exercise": "event_time_ns sequence scenario seed speed",
    "truth": "event_time_ns sequence north_m east_m down_m",
}
"""What a version-1 receiver may count on: fields may be added here, none may go."""

ADDED_SINCE = {
    "activity", "activity_confidence", "facing_sd_rad", "pressure_pa", "pressure_rows",
    "down_sd_m", "regions_m", "floors", "status", "reason", "clock", "spans", "said_ns", "lost",
    "near_log_odds", "range_m", "range_sd_m", "at_rest",
    "supplies", "leaves", "battery", "charging", "temperature_c", "air_bar", "air_left_s",
    "worry", "followed_until_ns",
}  # fmt: skip
"""Fields that a sender of the first version 1 does not know."""

POSITION_FIELDS = {"north_m", "east_m", "down_m", "covariance_m2"}

Path = tuple[str | int, ...]


def leaves(value: object, path: Path = ()) -> Iterator[Path]:
    """Yield the paths to all scalars within maps and lists."""
    if isinstance(value, dict):
        for name, entry in value.items():
            yield from leaves(entry, (*path, name))
    elif isinstance(value, list) and value:
        for index, entry in enumerate(value):
            yield from leaves(entry, (*path, index))
    else:
        yield path


def replaced(value: Any, path: Path, new: object) -> Any:
    """Return ``value`` with what is at ``path`` replaced by ``new``."""
    if not path:
        return new
    copy: Any = dict(value) if isinstance(value, dict) else list(value)
    copy[path[0]] = replaced(value[path[0]], path[1:], new)
    return copy


@every_topic
@few
@given(data=st.data())
def test_encoded_and_decoded_it_is_the_same(topic: str, data: st.DataObject) -> None:
    message = data.draw(messages(TOPICS[topic].message))
    assert decode(key_for(topic), encode(message)) == message


@every_topic
@few
@given(data=st.data())
def test_another_messagepack_reads_a_map_of_the_documented_fields(
    topic: str, data: st.DataObject
) -> None:
    message = data.draw(messages(TOPICS[topic].message))
    read = msgpack.unpackb(encode(message), use_list=False)
    absent = MAY_BE_ABSENT.get(topic, set()) - read.keys()
    assert list(read) == [name for name in WIRE_FIELDS[topic].split() if name not in absent]
    if read.get("position") is not None:
        assert set(read["position"]) == POSITION_FIELDS
    assert read == msgspec.to_builtins(message)


@every_topic
@few
@given(data=st.data())
def test_what_another_messagepack_writes_is_read(topic: str, data: st.DataObject) -> None:
    message = data.draw(messages(TOPICS[topic].message))
    fields = msgpack.unpackb(encode(message))
    names = data.draw(st.permutations(list(fields)))
    written = msgpack.packb({"future_field": [1, {"a": b"b"}]} | {n: fields[n] for n in names})
    assert decode(key_for(topic), written) == message


@every_topic
@few
@given(payload=st.binary(max_size=200))
def test_arbitrary_bytes_never_raise(topic: str, payload: bytes) -> None:
    decoded = decode(key_for(topic), payload)
    if isinstance(decoded, Refusal):
        assert decoded.reason in {"not_messagepack", "invalid"}
        assert decoded.detail
    else:
        assert decode(key_for(topic), encode(decoded)) == decoded


WRONG_ANYWHERE: dict[str, bytes] = {
    "not a number": msgpack.packb(float("nan")),
    "infinite": msgpack.packb(float("inf")),
    "minus infinite": msgpack.packb(float("-inf")),
    "beyond 63 bits": msgpack.packb(2**64 - 1),
    "far below": msgpack.packb(-(2**63)),
    "a boolean": msgpack.packb(True),
    "bytes": msgpack.packb(b"1"),
    "a map": msgpack.packb({"1": 1}),
    "a long text": msgpack.packb("?" * 5000),
    "no utf-8": b"\xa2\xff\xfe",
    "a reserved byte": b"\xc1",
    "a foreign extension": msgpack.packb(msgpack.ExtType(42, b"1")),
    "deeply nested": b"\x91" * 5000 + b"\xc0",
}
"""Values, as MessagePack, that fit no field of any message."""


@every_topic
@some
@given(wrong=st.sampled_from(list(WRONG_ANYWHERE)), data=st.data())
def test_a_wrong_value_anywhere_is_refused(topic: str, wrong: str, data: st.DataObject) -> None:
    fields = msgpack.unpackb(encode(data.draw(messages(TOPICS[topic].message))))
    path = data.draw(st.sampled_from(list(leaves(fields))))
    is_flag = isinstance(reduce(getitem, path, fields), bool)
    assume(not is_flag or wrong != "a boolean")
    marked = msgpack.packb(replaced(fields, path, "the wrong one"))
    payload = marked.replace(msgpack.packb("the wrong one"), WRONG_ANYWHERE[wrong])
    assert_refused(decode(key_for(topic), payload))


@every_topic
@some
@given(data=st.data())
def test_a_missing_field_is_refused(topic: str, data: st.DataObject) -> None:
    fields = msgpack.unpackb(encode(data.draw(messages(TOPICS[topic].message))))
    del fields[data.draw(st.sampled_from([name for name in fields if name not in ADDED_SINCE]))]
    assert_refused(decode(key_for(topic), msgpack.packb(fields)))


@given(data=st.data())
def test_an_increment_of_before_activities_is_read(data: st.DataObject) -> None:
    fields = msgpack.unpackb(encode(data.draw(messages(OdometryIncrement))))
    old = {name: value for name, value in fields.items() if name not in ADDED_SINCE}
    increment = decode(key_for("increment"), msgpack.packb(old))
    assert isinstance(increment, OdometryIncrement)
    assert (increment.activity, increment.activity_confidence) == ("unknown", 0.0)


@every_topic
@few
@given(data=st.data())
def test_a_truncated_or_prolonged_message_is_refused(topic: str, data: st.DataObject) -> None:
    payload = encode(data.draw(messages(TOPICS[topic].message)))
    length = data.draw(st.integers(0, len(payload) - 1))
    assert_refused(decode(key_for(topic), payload[:length]))
    assert_refused(decode(key_for(topic), payload + data.draw(st.binary(min_size=1, max_size=9))))


@every_topic
@pytest.mark.parametrize("payload", [b"\x91" * MAX_PAYLOAD_BYTES, b"\x81\xa1a" * 20_000])
def test_deep_nesting_is_refused(topic: str, payload: bytes) -> None:
    assert_refused(decode(key_for(topic), payload))


@every_topic
def test_a_message_too_large_is_refused_unread(topic: str) -> None:
    refusal = decode(key_for(topic), bytes(MAX_PAYLOAD_BYTES + 1))
    assert isinstance(refusal, Refusal)
    assert refusal.reason == "too_large"


def assert_refused(decoded: Message | Refusal) -> None:
    assert isinstance(decoded, Refusal)
    assert decoded.reason in {"invalid", "not_messagepack"}
    assert decoded.detail


node_ids = st.from_regex(r"[A-Za-z0-9_-]{1,32}", fullmatch=True)
keys = st.sampled_from(sorted(TOPICS)).flatmap(
    lambda topic: st.builds(
        Key, node_ids, st.sampled_from(TOPICS[topic].roles), node_ids, st.just(topic)
    )
)


@given(key=keys)
def test_a_key_written_and_parsed_is_the_same(key: Key) -> None:
    assert parse_key(str(key)) == key


@given(key=keys, version=st.text(st.characters(exclude_characters="/")).filter(lambda v: v != "v1"))
def test_another_version_is_told_as_such(key: Key, version: str) -> None:
    refusal = parse_key(str(key).replace("/v1/", f"/{version}/", 1))
    assert isinstance(refusal, Refusal)
    assert refusal.reason == "unknown_version"
    assert repr(version) in refusal.detail


@given(
    text=st.one_of(st.text(), st.lists(st.text(max_size=5), min_size=6, max_size=6).map("/".join))
)
def test_any_text_is_a_key_or_refused(text: str) -> None:
    parsed = parse_key(text)
    if isinstance(parsed, Key):
        assert str(parsed) == text
    else:
        assert parsed.reason in {"unknown_key", "unknown_version"}
        assert parsed.detail


@pytest.mark.parametrize("topic", list(TOPICS))
@pytest.mark.parametrize("role", ROLES)
def test_only_the_roles_of_a_topic_send_it(topic: str, role: str) -> None:
    parsed = parse_key(f"clew/v1/{INCIDENT}/{role}/{NODE}/{topic}")
    assert isinstance(parsed, Key) == (role in TOPICS[topic].roles)


@pytest.mark.parametrize("bad_id", ["", "a b", "é", "a" * 33, "a\n", "*"])
def test_a_malformed_id_is_refused(bad_id: str) -> None:
    assert isinstance(parse_key(f"clew/v1/{bad_id}/post/p1/exercise"), Refusal)
    assert isinstance(parse_key(f"clew/v1/i/post/{bad_id}/exercise"), Refusal)


def test_a_message_says_by_its_type_what_topic_it_is_of() -> None:
    assert [TOPIC_OF[topic.message] for topic in TOPICS.values()] == list(TOPICS.values())
