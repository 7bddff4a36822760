"""Nothing that a post keeps grows for ever, and nobody can tell from what it says live."""

from __future__ import annotations

import pickle
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
import pytest
from msgspec import structs

from command_post.desks.announcer import Outgoing
from command_post.fusion.settings import FusionSettings
from command_post.fusion.team import commits, lines, making
from command_post.fusion.team.crews import Crew
from command_post.fusion.team.log import TeamLog
from command_post.fusion.team.settings import TeamSettings
from command_post.incident import Incident
from command_post.incident_settings import IncidentSettings
from shared.codec import decode, encode, parse_key
from shared.messages import (
    DapEstimate,
    DapInstallation,
    LocalPosition,
    OdometryIncrement,
    RssiPeak,
)
from shared.topics import Key
from shared.units import NS_PER_S
from tests.benchmarks.crowd import START_NS, Said, crowd
from tests.benchmarks.test_team_speed import role_of, topic_of

TEAM = TeamSettings(horizon_s=40.0, lateness_s=60.0, crew_most=3)
SETTINGS = IncidentSettings(fusion=FusionSettings(team=TEAM))
MINUTES = 6.0
FULL_NS = START_NS + 240 * NS_PER_S
"""By then all that is kept for a while has been kept for that long."""

PLACE = LocalPosition(north_m=3.0, east_m=4.0, down_m=0.0, covariance_m2=(0.1, 0.0, 0.1))


def key_of(said: Said) -> str:
    return str(Key("exercise", role_of(said.message), said.node_id, topic_of(said.message)))


def hand(incident: Incident, said: Said, late_s: float = 0.02) -> Sequence[Outgoing]:
    now_ns = said.message.event_time_ns + round(late_s * NS_PER_S)
    return incident.handle(key_of(said), encode(said.message), now_ns)


def told(incident: Incident, said: Iterable[Said]) -> list[Outgoing]:
    return [outgoing for each in said for outgoing in hand(incident, each)]


def made_of(incident: Incident, said: Said, monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Let the incident have it; return when the commits were that this made."""
    times_ns: list[int] = []
    make = making.solved_crew

    def noted(crew: Crew, log: TeamLog, time_ns: int, *rest: Any) -> Any:
        times_ns.append(time_ns)
        return make(crew, log, time_ns, *rest)

    with monkeypatch.context() as patched:
        patched.setattr(commits, "solved_crew", noted)
        hand(incident, said)
    return times_ns


def size(incident: Incident) -> int:
    return len(pickle.dumps(incident, protocol=5))


@pytest.fixture(scope="module")
def said() -> list[Said]:
    return list(crowd([2], 0, MINUTES, 4.0, seed=4))


def test_what_is_kept_stays_as_much_and_what_is_told_is_the_same(said: list[Said]) -> None:
    forgetful, whole = Incident(SETTINGS, keeps_all=False), Incident(SETTINGS)
    full = [each for each in said if each.message.event_time_ns < FULL_NS]
    since = said[len(full) :]
    assert told(forgetful, full) == told(whole, full)
    before, whole_before = size(forgetful), size(whole)
    assert told(forgetful, since) == told(whole, since)
    assert size(forgetful) < 1.02 * before
    assert size(whole) > 1.1 * whole_before
    after, of_all = forgetful.afterwards(), whole.afterwards()
    assert after is not None
    assert of_all is not None
    for name, track in of_all.tracks.items():
        strides = sum(
            isinstance(each.message, OdometryIncrement) for each in said if each.node_id == name
        )
        assert len(track.time_s) >= strides
        assert len(after.tracks[name].time_s) < 0.5 * strides


def test_nor_does_it_while_there_is_no_solution(
    said: list[Said], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Who is never solved is never anchored, and is not kept for ever all the same."""
    monkeypatch.setattr(commits, "solved_crew", lambda *_: None)
    team = structs.replace(TEAM, horizon_s=10.0, lateness_s=20.0, crew_most=1)
    incident = Incident(IncidentSettings(fusion=FusionSettings(team=team)), keeps_all=False)
    sizes = []
    for number, each in enumerate(said):
        hand(incident, each)
        if number % 480 == 479:
            sizes.append(size(incident))
    assert max(sizes[-2:]) < 1.02 * max(sizes[-4:-2])


def test_who_is_late_within_what_is_allowed_leaves_no_trace(
    said: list[Said], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Both as a small team, and as crews of a large one; by more than is kept of the past.

    At once or a commit at each tick.
    """
    for name in ("KEPT", "KEPT_OF_A_CROWD", "KEYFRAME_EVERY"):
        monkeypatch.setattr(commits, name, 3)
    for crew_most, at_once in ((3, False), (1, False), (1, True)):
        for name, least in (("AT_ONCE_WORK", 0), ("CROWD_WORK", 1)):
            monkeypatch.setattr(lines, name, 10_000 if at_once else least)
        monkeypatch.setattr(lines, "TICK_WORK", 1)
        team = structs.replace(TEAM, crew_most=crew_most, anchor_s=20.0)
        settings = IncidentSettings(fusion=FusionSettings(team=team))
        end_ns = START_NS + 110 * NS_PER_S
        in_time = [each for each in said if each.message.event_time_ns < end_ns]
        silent_ns = (end_ns - 55 * NS_PER_S, end_ns - 48 * NS_PER_S)
        late = [
            each for each in in_time
            if each.node_id == "r0-1" and silent_ns[0] < each.message.event_time_ns < silent_ns[1]
        ]  # fmt: skip
        rest = [each for each in in_time if each not in late]
        chance = np.random.default_rng(6)
        one, other = Incident(settings, keeps_all=False), Incident(settings, keeps_all=False)
        told(one, in_time)
        told(other, rest)
        for at in chance.permutation(len(late)).tolist():
            handled_ns = rest[-1].message.event_time_ns + NS_PER_S // 50
            other.handle(key_of(late[at]), encode(late[at].message), handled_ns)
        closing = said[len(in_time) :][:320]
        told(one, closing)
        made = [len(made_of(other, each, monkeypatch)) for each in closing]
        # Of a team one commit is due by itself at times, and of a crowd one of each crew.
        assert (max(made) > 3) == at_once
        assert dict(one.estimates) == dict(other.estimates)
        assert dict(one.daps) == dict(other.daps)


def test_what_comes_too_late_is_told_of_and_counts_afterwards(said: list[Said]) -> None:
    few = [each for each in said if each.message.event_time_ns < START_NS + 90 * NS_PER_S]
    at = next(at for at, each in enumerate(few) if isinstance(each.message, RssiPeak))
    late = few.pop(at)
    incident, whole = Incident(SETTINGS), Incident(SETTINGS)
    told(incident, few)
    told(whole, sorted([*few, late], key=lambda each: each.message.event_time_ns))
    without = dict(incident.estimates)
    hand(incident, late, late_s=61.0)
    assert dict(incident.estimates) == without
    assert incident.counts["too_late"] == 1
    (notice,) = [each for each in incident.take_notices() if each.reason == "too_late"]
    assert (notice.node_id, notice.detail) == (
        late.node_id, "dap: it tells of more than 1 min ago: recorded, and not on the map",
    )  # fmt: skip
    now_ns = late.message.event_time_ns + 62 * NS_PER_S
    words = "1 messages too late: it tells of more than 1 min ago: recorded, and not on the map"
    assert words in incident.faults("dap", late.node_id, now_ns)
    assert words not in incident.faults("dap", late.node_id, now_ns + 60 * NS_PER_S)
    after, of_all = incident.afterwards(), whole.afterwards()
    assert after is not None
    assert of_all is not None
    for name, track in of_all.tracks.items():
        assert np.allclose(after.tracks[name].position_m, track.position_m, atol=0.02)


def test_a_dap_that_has_stood_for_long_stands_where_it_says(said: list[Said]) -> None:
    few = [each for each in said if each.message.event_time_ns < START_NS + 70 * NS_PER_S]
    incident = Incident(SETTINGS, keeps_all=False)
    told(incident, few)
    installed_ns = START_NS - 7200 * NS_PER_S
    stands = DapInstallation(
        event_time_ns=installed_ns, sequence=0, installer_id=None, position=PLACE
    )
    made: list[Outgoing] = []
    for number in range(2):
        again = structs.replace(stands, sequence=number)
        now_ns = START_NS + (80 + 5 * number) * NS_PER_S
        key = str(Key("exercise", "dap", "known", "installation"))
        made += incident.handle(key, encode(again), now_ns)
        stride = structs.replace(
            next(e.message for e in few if isinstance(e.message, OdometryIncrement)),
            event_time_ns=now_ns + NS_PER_S, start_time_ns=now_ns, sequence=9000 + number,
        )  # fmt: skip
        made += hand(incident, Said("r0-0", stride))
    place = incident.daps["known"].position
    assert (round(place.north_m, 3), round(place.east_m, 3)) == (3.0, 4.0)
    estimates = [
        message for each in made
        if isinstance(key_now := parse_key(each.key), Key)
        and isinstance(message := decode(key_now, each.payload), DapEstimate)
        and message.dap_id == "known"
    ]  # fmt: skip
    # The DAP knows by this time that it is meant.
    assert {each.event_time_ns for each in estimates} == {installed_ns}
