"""What a commander reads first: alarms, then the rest."""

from __future__ import annotations

import msgspec
from rich.console import Console

from command_post.incident import Incident, IncidentSettings
from command_post.roster import ResponderRow, Roster, RosterSettings, make_roster
from command_post.table import roster_table
from shared.codec import encode
from shared.messages import Activity, Alarm, AlarmKind, AlarmPhase, Message, NodeHealth
from tests.stride_world import at_ns, key_of, stride, track_start

SETTINGS = RosterSettings(tied_s=30.0, lost_s=10.0, still_s=5.0)


def alarm(time_s: float, kind: AlarmKind, phase: AlarmPhase, sequence: int = 0) -> Alarm:
    return Alarm(
        event_time_ns=at_ns(time_s),
        sequence=sequence,
        kind=kind,
        phase=phase,
        confidence=1.0,
        reason=f"{kind} for a reason",
    )


def walked(time_s: float, activity: Activity, confidence: float = 0.9) -> Message:
    return msgspec.structs.replace(
        stride(time_s, 1.2, 0.0), activity=activity, activity_confidence=confidence
    )


def incident_with(*heard: tuple[str, float, Message]) -> Incident:
    """Return an incident that heard messages from responders, each at a time."""
    incident = Incident(IncidentSettings())
    for node_id, time_s, message in heard:
        key = key_of("responder", node_id, type(message))
        incident.handle(str(key), encode(message), at_ns(time_s))
    return incident


def rows(incident: Incident, time_s: float) -> tuple[ResponderRow, ...]:
    return make_roster(incident, at_ns(time_s), SETTINGS).responders


def shown(roster: Roster) -> str:
    console = Console(width=120)
    with console.capture() as captured:
        console.print(roster_table(roster))
    return " ".join(captured.get().split())


def test_who_has_an_alarm_comes_first() -> None:
    incident = incident_with(
        ("r1", 0.0, track_start(0.0)),
        ("r2", 0.0, track_start(0.0)),
        ("r2", 1.0, alarm(1.0, "motionless", "pre_alarm")),
    )
    assert [row.responder_id for row in rows(incident, 2.0)] == ["r2", "r1"]
    said = shown(make_roster(incident, at_ns(2.0), SETTINGS))
    assert "MOTIONLESS soon" in said
    assert said.index("r2 ") < said.index("MOTIONLESS") < said.index("r1 ")


def test_the_worst_alarm_that_stands_is_shown_and_the_newest_of_equals() -> None:
    first = ("r1", 1.0, alarm(1.0, "fall", "alarm"))
    second = ("r1", 2.0, alarm(2.0, "motionless", "pre_alarm", 1))
    third = ("r1", 3.0, alarm(3.0, "motionless", "alarm", 2))
    over = ("r1", 4.0, alarm(4.0, "motionless", "cancelled", 3))
    for heard, kind in (
        ((first, second), "fall"),
        ((first, second, third), "motionless"),
        ((first, second, third, over), "fall"),
    ):
        (row,) = rows(incident_with(*heard), 5.0)
        assert row.alarm is not None
        assert row.alarm.kind == kind


def test_a_cancelled_alarm_stays_so_though_an_older_message_comes_late() -> None:
    raised, over = alarm(1.0, "fall", "alarm"), alarm(4.0, "fall", "cancelled", 1)
    incident = incident_with(("r1", 1.0, raised), ("r1", 4.0, over), ("r1", 5.0, raised))
    assert rows(incident, 6.0)[0].alarm is None


def test_an_alarm_after_the_units_clock_was_set_back_is_believed() -> None:
    over = alarm(1000.0, "fall", "cancelled", 7)
    incident = incident_with(("r1", 1.0, over), ("r1", 2.0, alarm(3.0, "fall", "alarm", 8)))
    assert rows(incident, 6.0)[0].alarm is not None


def test_an_alarm_is_kept_when_its_unit_falls_silent() -> None:
    incident = incident_with(("r1", 1.0, alarm(1.0, "fall", "alarm")))
    (row,) = rows(incident, 60.0)
    assert row.status == "lost"
    assert row.alarm is not None


def test_what_they_do_is_shown_while_it_is_known() -> None:
    incident = incident_with(("r1", 1.0, walked(1.0, "stairs_up")))
    assert rows(incident, 2.0)[0].activity == "going upstairs"
    assert rows(incident, 7.0)[0].activity == "standing still"
    assert rows(incident, 60.0)[0].activity is None
    assert "going upstairs" in shown(make_roster(incident, at_ns(2.0), SETTINGS))


def test_a_doubtful_activity_is_not_shown() -> None:
    incident = incident_with(("r1", 1.0, walked(1.0, "crawl", 0.4)))
    assert rows(incident, 2.0)[0].activity is None


def test_what_is_wrong_with_the_sensor_is_shown() -> None:
    health = NodeHealth(
        event_time_ns=at_ns(1.0), sequence=0, level="fault", findings=("Swap it", "Or not")
    )
    sound = NodeHealth(
        event_time_ns=at_ns(2.0), sequence=1, level="ok", findings=("Worn as it should be",)
    )
    incident = incident_with(("r1", 1.0, health))
    assert rows(incident, 2.0)[0].fault == "Swap it"
    assert "Swap it" in shown(make_roster(incident, at_ns(2.0), SETTINGS))
    assert rows(incident_with(("r1", 1.0, health), ("r1", 2.0, sound)), 3.0)[0].fault is None


def test_what_is_wrong_with_the_post_itself_is_shown_below() -> None:
    roster = make_roster(incident_with(("r1", 0.0, track_start(0.0))), at_ns(1.0), SETTINGS)
    assert "without a plan" not in shown(roster)
    remarked = roster._replace(remarks=("going on without a plan: house.geojson: cannot be read",))
    assert shown(remarked).endswith("going on without a plan: house.geojson: cannot be read")
