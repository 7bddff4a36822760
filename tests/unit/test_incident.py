"""The incident: decodes, refuses and counts, fuses, and says what comes of it."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest

from command_post import incident as incident_module
from command_post.desks.announcer import Outgoing
from command_post.desks.command_desk import START_ID
from command_post.fusion.settings import FusionMethod, FusionSettings
from command_post.fusion.time_line import TimeLineSettings
from command_post.incident import Incident, IncidentSettings
from command_post.nodes import notices
from command_post.nodes.notices import Notice
from shared.codec import decode, encode, parse_key
from shared.geodesy import Origin
from shared.messages import (
    DapEstimate,
    LocalPosition,
    Message,
    OriginSet,
    PositionFix,
    RssiReport,
    TrackEstimate,
)
from shared.topics import Key, Role
from tests.stride_world import (
    at_ns,
    exercise,
    installation,
    key_of,
    proximity,
    stride,
    track_start,
)


def hear(incident: Incident, role: Role, node_id: str, message: Message) -> list[Outgoing]:
    key = key_of(role, node_id, type(message))
    return incident.handle(str(key), encode(message), message.event_time_ns)


def decoded(outgoing: Outgoing) -> Message:
    key = parse_key(outgoing.key)
    assert isinstance(key, Key)
    message = decode(key, outgoing.payload)
    assert isinstance(message, Message), message
    return message


def test_what_comes_of_it_goes_out_under_the_posts_keys() -> None:
    incident = Incident(IncidentSettings(fusion=FusionSettings(method="published")))
    made = [
        *hear(incident, "responder", "r1", track_start(0.0)),
        *hear(incident, "responder", "r1", stride(1.0, 1.2, 0.0)),
        *hear(incident, "dap", "dap2", installation(1.5, "r1")),
        *hear(incident, "dap", "dap2", proximity(1.8, "r1")),
        *incident.finish(at_ns(2.0)),
    ]
    track, dap_place = (f"clew/v1/exercise/post/post/{topic}" for topic in ("track", "dap_place"))
    assert [outgoing.key for outgoing in made] == [track, track, dap_place, track]
    first, second, placed, tied = map(decoded, made)
    assert isinstance(second, TrackEstimate)
    assert isinstance(placed, DapEstimate)
    assert isinstance(tied, TrackEstimate)
    assert placed.position.north_m == second.north_m
    assert placed.event_time_ns == at_ns(1.5)
    assert tied.last_proximity_time_ns == at_ns(1.8)
    assert [first.sequence, second.sequence, tied.sequence, placed.sequence] == [0, 1, 2, 0]


def fix_of(time_s: float, responder_id: str) -> PositionFix:
    place = LocalPosition(north_m=2.2, east_m=0.0, down_m=0.0, covariance_m2=(0.04, 0.0, 0.04))
    return PositionFix(
        event_time_ns=at_ns(time_s), sequence=0, responder_id=responder_id, source="commander",
        position=place,
    )  # fmt: skip


def test_a_commanders_word_counts_and_nobody_elses_about_another() -> None:
    incident = Incident(IncidentSettings())
    hear(incident, "responder", "r1", track_start(0.0))
    hear(incident, "responder", "r1", stride(1.0, 1.2, 0.0))
    hear(incident, "post", "commander", fix_of(1.0, "r1"))
    hear(incident, "responder", "r2", fix_of(1.0, "r1"))
    hear(incident, "responder", "r1", stride(12.0, 0.0, 0.0, sequence=1))
    incident.finish(at_ns(20.0))
    assert incident.estimates["r1"].north_m > 1.6
    assert incident.refusals == {("not_ones_own", "r2"): 1}


def test_nothing_is_released_before_the_hold() -> None:
    incident = Incident(IncidentSettings(time_line=TimeLineSettings(hold_s=1.5)))
    assert hear(incident, "responder", "r1", track_start(0.0)) == []
    assert hear(incident, "responder", "r1", stride(1.0, 1.2, 0.0)) == []
    assert len(hear(incident, "responder", "r1", stride(2.0, 1.2, 0.0, sequence=1))) == 1


def test_what_is_due_needs_no_further_message_to_come_out() -> None:
    incident = Incident(IncidentSettings())
    assert incident.due_ns is None
    assert hear(incident, "responder", "r1", track_start(0.0)) == []
    due_ns = at_ns(0.0) + incident.settings.hold_ns
    assert incident.due_ns == due_ns
    assert incident.pass_time(due_ns - 1) == []
    assert len(incident.pass_time(due_ns)) == 1
    silent_ns = incident.due_ns
    assert silent_ns is not None
    assert incident.pass_time(silent_ns - 1) == []
    (told,) = map(decoded, incident.pass_time(silent_ns))
    assert isinstance(told, TrackEstimate)
    assert (told.status, told.reason) == ("lost", "nothing heard for 20 s")


@pytest.mark.parametrize("method", ["team", "published"])
def test_when_time_was_said_to_pass_leaves_no_trace(method: FusionMethod) -> None:
    chance = np.random.default_rng(4)
    heard = sorted(
        each._replace(now_ns=each.now_ns + round(chance.exponential(0.3e9)))
        for each in exercise(3)[:400]
    )
    settings = IncidentSettings(fusion=FusionSettings(method=method, particles=50))

    def made(wakes_between: int) -> list[Outgoing]:
        incident = Incident(settings)
        told = []
        before_ns = heard[0].now_ns
        for now_ns, key, payload in heard:
            for passed_ns in sorted(chance.integers(before_ns, now_ns + 1, wakes_between).tolist()):
                told += incident.pass_time(passed_ns)
            told += incident.handle(key, payload, now_ns)
            before_ns = now_ns
        return told + incident.finish(before_ns)

    without = made(0)
    assert len(without) > 100
    assert made(3) == without


def test_who_fuses_in_order_waits_longer() -> None:
    team, published = (
        IncidentSettings(fusion=FusionSettings(method=method)) for method in ("team", "published")
    )
    assert team.hold_ns < published.hold_ns
    held = msgspec.structs.replace(published, time_line=TimeLineSettings(hold_s=0.5))
    assert held.hold_ns == at_ns(0.5) - at_ns(0.0)


@pytest.mark.parametrize(
    ("key", "payload", "kind"),
    [
        ("nonsense", b"", ("unknown_key", "?")),
        ("clew/v9/exercise/responder/r1/increment", b"", ("unknown_version", "r1")),
        ("clew/v1/exercise/responder/r1/nothing", b"", ("unknown_key", "r1")),
        ("clew/v1/exercise/responder/r1/increment", b"\xc1", ("not_messagepack", "r1")),
        ("clew/v1/exercise/responder/r1/increment", b"\x80", ("invalid", "r1")),
        ("clew/v1/exercise/responder/r1/imu", b"\x80", ("invalid", "r1")),
        ("clew/v1/exercise/dap/d1/truth", b"\x80", ("invalid", "d1")),
        ("clew/v1/exercise/dap/d1/rssi", bytes(70_000), ("too_large", "d1")),
    ],
)
def test_what_is_refused_is_counted_and_told_once(
    key: str, payload: bytes, kind: tuple[str, str]
) -> None:
    incident = Incident(IncidentSettings())
    for _ in range(3):
        assert incident.handle(key, payload, at_ns(0.0)) == []
    assert incident.refusals == {kind: 3}
    (notice,) = incident.take_notices()
    assert (notice.reason, notice.node_id) == kind
    assert notice.detail
    assert incident.take_notices() == []
    assert not incident.heard_ns


def test_another_incident_is_refused() -> None:
    incident = Incident(IncidentSettings(incident="here"))
    hear(incident, "responder", "r1", track_start(0.0))
    assert incident.refusals == {("foreign_incident", "r1"): 1}
    assert incident.take_notices() == [Notice("foreign_incident", "r1", "of 'exercise'")]
    assert incident.finish(at_ns(9.0)) == []


def test_what_another_post_says_is_checked_and_not_fused() -> None:
    incident = Incident(IncidentSettings())
    assert incident.handle("clew/v1/exercise/post/other/track", b"anything", at_ns(0.0)) == []
    assert incident.refusals == {("invalid", "other"): 1}
    assert not incident.estimates


def test_what_is_said_under_the_posts_own_keys_by_somebody_else_is_refused() -> None:
    incident = Incident(IncidentSettings())
    for _ in "ab":
        assert incident.handle("clew/v1/exercise/post/post/track", b"anything", at_ns(0.0)) == []
    assert incident.refusals == {("not_the_post", "post"): 2}
    assert [notice.reason for notice in incident.take_notices()] == ["not_the_post"]


def test_raw_readings_are_heard_and_not_fused() -> None:
    incident = Incident(IncidentSettings())
    report = RssiReport(event_time_ns=at_ns(1.0), sequence=0, responder_id="r1", rssi_dbm=-40.0)
    hear(incident, "dap", "d1", report)
    assert incident.heard_ns == {("dap", "d1"): at_ns(1.0)}
    assert incident.finish(at_ns(9.0)) == []


def test_nodes_beyond_the_limit_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(incident_module, "MOST_NODES", 2)
    incident = Incident(IncidentSettings())
    for name in ("r1", "r2", "r3", "r1"):
        hear(incident, "responder", name, stride(1.0, 1.0, 0.0))
    assert incident.refusals == {("too_many_nodes", "r3"): 1}
    incident.finish(at_ns(9.0))
    assert set(incident.estimates) == {"r1", "r2"}


def test_kinds_of_refusal_are_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(notices, "MOST_REFUSAL_KINDS", 2)
    incident = Incident(IncidentSettings())
    for k in range(5):
        incident.handle(f"clew/v1/exercise/responder/r{k}/imu", b"", at_ns(0.0))
    assert incident.refusals[("not_messagepack", "?")] + len(incident.refusals) - 1 == 5
    assert len(incident.refusals) == 3


def test_what_was_sent_twice_counts_once() -> None:
    once, twice = Incident(IncidentSettings()), Incident(IncidentSettings())
    heard = exercise(1)[:200]
    made_once = [o for h in heard for o in once.handle(h.key, h.payload, h.now_ns)]
    made_twice = [o for h in heard for _ in "ab" for o in twice.handle(h.key, h.payload, h.now_ns)]
    assert made_once == made_twice
    assert twice.counts["repeated"] > 100


def test_settings_travel_with_a_recording() -> None:
    settings = IncidentSettings(incident="fire-7", post_id="cp")
    assert IncidentSettings.from_metadata(settings.as_metadata()) == settings
    with pytest.raises(ValueError, match="does not say its settings"):
        IncidentSettings.from_metadata({})
    with pytest.raises(ValueError, match="cannot be used"):
        IncidentSettings.from_metadata({"incident_settings": '{"incident": 4}'})


def test_a_setting_that_never_had_an_effect_is_read_over() -> None:
    of_team = '{"near_sd_m": 2.5, "install_sd_m": 0.4}'
    told = {"incident_settings": f'{{"fusion": {{"team": {of_team}}}}}'}
    assert IncidentSettings.from_metadata(told).fusion.team.install_sd_m == 0.4
    with pytest.raises(ValueError, match="far_sd_m"):
        IncidentSettings.from_metadata(
            {"incident_settings": told["incident_settings"].replace("near", "far")}
        )


def test_the_origin_is_what_somebody_set_last_and_not_what_a_start_repeats() -> None:
    incident = Incident(IncidentSettings())

    def said(by: str, latitude_deg: float) -> list[Message]:
        message = Origin(latitude_deg=latitude_deg, longitude_deg=127.0).as_message(5, 0)
        made = incident.handle(f"clew/v1/exercise/post/{by}/origin", encode(message), at_ns(1.0))
        return [decoded(each) for each in made]

    (first,) = said(START_ID, 37.5)
    assert isinstance(first, OriginSet)
    assert (first.latitude_deg, first.event_time_ns) == (37.5, at_ns(1.0))
    assert len(said("kim", 37.6)) == 1
    assert said(START_ID, 37.5) == []
    assert incident.origin is not None
    assert incident.origin.key == "clew/v1/exercise/post/post/origin"
