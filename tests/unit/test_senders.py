"""Wrong clocks and doubled ids: noticed, said once, and borne with."""

from __future__ import annotations

from collections.abc import Iterable
from typing import get_args

import pytest

from command_post.fusion.settings import FusionMethod, FusionSettings
from command_post.incident import Incident, IncidentSettings
from command_post.nodes.notices import Notice
from command_post.roster import RosterSettings, make_roster
from shared.codec import decode, encode, parse_key
from shared.messages import DapEstimate, Message, NodeHealth
from shared.topics import Key, Role
from tests.stride_world import at_ns, installation, key_of, proximity, stride, track_start

DAY_S = 86_400.0


def hear(
    incident: Incident, arrival_s: float, role: Role, node_id: str, message: Message
) -> list[Message]:
    """Let a message arrive, and return what the incident makes of it."""
    key = str(key_of(role, node_id, type(message)))
    return decoded(incident.handle(key, encode(message), at_ns(arrival_s)))


def decoded(outgoing: Iterable[tuple[str, bytes]]) -> list[Message]:
    messages = []
    for key_text, payload in outgoing:
        key = parse_key(key_text)
        assert isinstance(key, Key)
        message = decode(key, payload)
        assert isinstance(message, Message)
        messages.append(message)
    return messages


def walk(incident: Incident, node_id: str, ahead_s: float, arrivals_s: Iterable[float]) -> None:
    """Let a responder walk north whose clock is ``ahead_s`` ahead of the post's."""
    for sequence, arrival_s in enumerate(arrivals_s):
        said = stride(arrival_s - 0.2 + ahead_s, 1.2, 0.0, sequence=sequence)
        hear(incident, arrival_s, "responder", node_id, said)


def health(time_s: float, sequence: int = 0) -> NodeHealth:
    return NodeHealth(event_time_ns=at_ns(time_s), sequence=sequence, level="ok", findings=())


@pytest.mark.parametrize(
    ("ahead_s", "words"),
    [
        (DAY_S, "clock ahead by 1 d"),
        (-40.0, "clock behind by 40 s"),
        (-300.0, "clock behind by 5 min"),
        (5400.0, "clock ahead by 1.5 h"),
        (-9.0, None),
        (0.4, None),
        (2.0, "clock ahead by 2 s"),
    ],
)
def test_a_wrong_clock_is_said_once_and_shown(ahead_s: float, words: str | None) -> None:
    incident = Incident(IncidentSettings())
    hear(incident, 0.0, "responder", "r1", track_start(ahead_s))
    walk(incident, "r1", ahead_s, range(1, 20))
    told = [] if words is None else [Notice("wrong_clock", "r1", f"responder: {words}")]
    assert incident.take_notices() == told
    (row,) = make_roster(incident, at_ns(20.0), RosterSettings()).responders
    assert row.fault == words


@pytest.mark.parametrize("ahead_s", [DAY_S, -40.0, 2.0])
def test_what_a_wrong_clock_dates_is_put_on_the_posts_time_line(ahead_s: float) -> None:
    incident = Incident(IncidentSettings())
    walk(incident, "r1", ahead_s, range(1, 20))
    incident.finish(at_ns(20.0))
    assert incident.estimates["r1"].time_ns == pytest.approx(at_ns(19.0), abs=0.3e9)
    assert incident.counts["moved_in_time"] == 19


def test_a_clock_that_is_ahead_is_known_to_be_while_messages_take_longer_than_that() -> None:
    incident = Incident(IncidentSettings())
    walk(incident, "r1", 2.0, [1.0, 2.0, 3.0])
    for number in range(4, 8):
        said = stride(number - 0.2 + 2.0, 1.2, 0.0, sequence=number)
        hear(incident, number + 5.0, "responder", "r1", said)
    incident.finish(at_ns(14.0))
    assert incident.counts["moved_in_time"] == 7
    assert incident.estimates["r1"].time_ns == pytest.approx(at_ns(7.0), abs=0.3e9)


def test_a_message_that_took_long_does_not_make_a_clock_wrong() -> None:
    incident = Incident(IncidentSettings())
    walk(incident, "r1", 0.0, range(1, 5))
    hear(incident, 45.0, "responder", "r1", stride(5.0, 1.2, 0.0, sequence=5))
    assert incident.take_notices() == []
    assert incident.counts["moved_in_time"] == 0


def test_an_old_start_that_was_asked_for_does_not_make_a_clock_wrong() -> None:
    incident = Incident(IncidentSettings())
    hear(incident, 600.0, "responder", "r1", track_start(0.0))
    hear(incident, 600.1, "responder", "r1", health(600.0))
    assert incident.take_notices() == []


def test_in_an_exercise_in_a_hurry_nobody_is_to_blame() -> None:
    settings = IncidentSettings.from_metadata(
        {"incident_settings": '{"time_line": {"hold_s": 30.0}}'}
    )
    incident = Incident(settings)
    walk(incident, "r1", -60.0, range(1, 20))
    assert incident.take_notices() == []


@pytest.mark.parametrize("method", get_args(FusionMethod))
def test_who_was_a_day_ahead_and_starts_again_right_is_believed(method: FusionMethod) -> None:
    incident = Incident(IncidentSettings(fusion=FusionSettings(method=method)))
    hear(incident, 0.0, "responder", "r1", track_start(DAY_S))
    walk(incident, "r1", DAY_S, range(1, 5))
    hear(incident, 9.0, "responder", "r1", track_start(9.0))
    walk(incident, "r1", 0.0, range(10, 20))
    incident.finish(at_ns(20.0))
    assert incident.counts["stale_start"] == 0
    estimate = incident.estimates["r1"]
    assert estimate.time_ns == at_ns(18.8)
    # The start was at the origin.
    assert estimate.north_m == pytest.approx(12.0, abs=2.0)
    assert make_roster(incident, at_ns(20.0), RosterSettings()).responders[0].fault is None


def test_a_dap_whose_clock_is_behind_stands_where_its_installer_was_when_it_was_set_down() -> None:
    settings = IncidentSettings(fusion=FusionSettings(method="published"))
    incident, behind_s = Incident(settings), 120.0
    walk(incident, "r1", 0.0, range(1, 150))
    before_m = incident.estimates["r1"].north_m
    # It is not known to be behind until it says what only happens now.
    made = hear(incident, 150.0, "dap", "dap2", installation(150.0 - behind_s, "r1"))
    assert not any(isinstance(each, DapEstimate) for each in made)
    made = hear(incident, 151.0, "dap", "dap2", proximity(151.0 - behind_s, "r1"))
    made += decoded(incident.finish(at_ns(152.0)))
    (placed,) = (each for each in made if isinstance(each, DapEstimate))
    assert placed.position.north_m == pytest.approx(before_m, abs=3.0)
    assert placed.event_time_ns == at_ns(150.0 - behind_s), "or the DAP would not know itself"
    assert incident.take_notices()[0].detail == "dap: clock behind by 2 min"
    (row,) = make_roster(incident, at_ns(152.0), RosterSettings()).daps
    assert row.fault == "clock behind by 2 min"


def test_a_dap_that_says_again_where_it_stands_is_not_moved() -> None:
    incident = Incident(IncidentSettings())
    walk(incident, "r1", 0.0, range(1, 20))
    for k in range(5):
        late_s = 0.3 / (k + 1)
        said = proximity(20.0 + k - late_s - 60.0, "r2", sequence=k)
        hear(incident, 20.0 + k, "dap", "dap2", said)
        hear(incident, 20.0 + k, "dap", "dap2", installation(-55.0, "r1", sequence=k))
    incident.finish(at_ns(30.0))
    assert incident.counts["superseded"] == 0
    assert incident.daps["dap2"].installed_ns == pytest.approx(at_ns(5.0), abs=1e9)


def test_two_units_with_one_id_are_noticed_once_and_shown() -> None:
    incident = Incident(IncidentSettings())
    for k in range(12):
        for first, later_s in ((0, 0.0), (40, 0.4)):
            said = stride(k + later_s, 1.2, 0.0, sequence=first + k)
            hear(incident, k + later_s, "responder", "r1", said)
    words = "two units go by this id, or one begins anew over and over"
    assert incident.take_notices() == [Notice("doubled_id", "r1", f"responder: {words}")]
    assert incident.counts["begun_anew"] == 11
    for now_s, fault in ((12.0, words), (120.0, None)):
        (row,) = make_roster(incident, at_ns(now_s), RosterSettings()).responders
        assert row.fault == fault


def test_two_starts_and_messages_out_of_order_are_no_second_unit() -> None:
    incident = Incident(IncidentSettings())
    for again_s in (0.0, 30.0):
        for k in (0, 1, 3, 2, 4, 6, 5, 8, 7, 9):
            said = stride(again_s + k, 1.2, 0.0, sequence=k)
            hear(incident, again_s + k, "responder", "r1", said)
    assert incident.take_notices() == []
    assert incident.counts["begun_anew"] == 1
