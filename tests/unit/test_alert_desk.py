"""What the commander is alerted to: once each, dated by when it was due, over when it is."""

from __future__ import annotations

from command_post.desks.alert_desk import SILENT_NS, AlertDesk, Known, Node
from shared.messages import Alarm, AlarmPhase, Alert, AlertRequest, Beat, Message, StrangerNoticed
from shared.units import NS_PER_S

R1: Node = ("responder", "r1")
DAP: Node = ("dap", "dap1")


def beat(at_s: float) -> Beat:
    return Beat(
        event_time_ns=round(at_s * NS_PER_S), sequence=0, run="0" * 16, last_number=0, kept_from=0,
        acknowledged=0,
    )  # fmt: skip


def alarm(phase: AlarmPhase, reason: str = "for 30 s") -> Alarm:
    return Alarm(
        event_time_ns=0, sequence=0, kind="motionless", phase=phase, confidence=1.0, reason=reason
    )


def hear(desk: AlertDesk, node: Node, message: Message, at_s: float) -> list[Alert]:
    now_ns = round(at_s * NS_PER_S)
    return [*desk.pass_time(now_ns), *desk.hear(node, message, now_ns)]


def request(number: int, stage: str, to: str | None = None) -> AlertRequest:
    assert stage in ("acknowledged", "assigned", "resolved")
    return AlertRequest(event_time_ns=0, sequence=0, number=number, stage=stage, assigned_to=to)  # type: ignore[arg-type]


def test_who_beats_and_falls_silent_is_alerted_to_once_and_dated_by_when_it_was_due() -> None:
    desk = AlertDesk(hold_ns=0)
    assert hear(desk, R1, beat(1.0), 1.0) == []
    assert hear(desk, R1, alarm("cancelled"), 4.0) == []  # whatever it says, it is there
    assert desk.pass_time(round(13.9 * NS_PER_S)) == []
    (lost,) = desk.pass_time(60 * NS_PER_S)
    assert (lost.kind, lost.node_id, lost.stage) == ("lost_contact", "r1", "raised")
    assert lost.since_ns == 4 * NS_PER_S + SILENT_NS
    assert desk.pass_time(600 * NS_PER_S) == []
    (found,) = hear(desk, R1, beat(601.0), 601.0)
    assert (found.number, found.stage, found.by) == (lost.number, "resolved", None)


def test_when_time_is_passed_makes_no_difference() -> None:
    often, seldom = AlertDesk(0), AlertDesk(0)
    for desk in (often, seldom):
        hear(desk, R1, beat(1.0), 1.0)
        hear(desk, DAP, beat(3.0), 3.0)
    told = [each for at_s in range(3, 31) for each in often.pass_time(at_s * NS_PER_S)]
    assert told == seldom.pass_time(30 * NS_PER_S)
    assert [each.node_id for each in told] == ["r1", "dap1"]
    assert often.due_ns is seldom.due_ns is None


def test_who_never_beats_is_not_missed() -> None:
    desk = AlertDesk(0)
    hear(desk, R1, alarm("cancelled"), 1.0)
    assert desk.pass_time(3600 * NS_PER_S) == []


def test_an_alarm_that_gets_worse_is_raised_again_and_one_that_repeats_is_not() -> None:
    desk = AlertDesk(0)
    (warned,) = hear(desk, R1, alarm("pre_alarm"), 20.0)
    (seen,) = desk.request("chief", request(warned.number, "acknowledged"), 21 * NS_PER_S)
    assert (seen.stage, seen.by) == ("acknowledged", "chief")
    (raised,) = hear(desk, R1, alarm("alarm"), 30.0)
    assert (raised.number, raised.stage) == (warned.number, "raised")
    assert hear(desk, R1, alarm("alarm"), 35.0) == []
    (over,) = hear(desk, R1, alarm("cancelled", "moves"), 40.0)
    assert (over.stage, over.words) == ("resolved", "moves")
    (again,) = hear(desk, R1, alarm("alarm"), 90.0)
    assert again.number != warned.number


def test_what_somebody_resolved_is_not_raised_by_its_repeats() -> None:
    desk = AlertDesk(0)
    (raised,) = hear(desk, R1, alarm("alarm"), 30.0)
    desk.request("chief", request(raised.number, "resolved"), 31 * NS_PER_S)
    assert hear(desk, R1, alarm("alarm"), 35.0) == []
    hear(desk, R1, alarm("cancelled"), 50.0)
    (anew,) = hear(desk, R1, alarm("alarm"), 90.0)
    assert anew.stage == "raised"


def test_it_is_assigned_to_somebody_who_is_named() -> None:
    desk = AlertDesk(0)
    (raised,) = hear(desk, R1, alarm("alarm"), 30.0)
    assert desk.request("chief", request(raised.number, "assigned"), 0) == []
    (given,) = desk.request("chief", request(raised.number, "assigned", "r2"), 0)
    assert (given.stage, given.assigned_to, given.by) == ("assigned", "r2", "chief")
    assert desk.request("chief", request(99, "resolved"), 0) == []
    desk.request("chief", request(raised.number, "resolved"), 0)
    assert desk.request("chief", request(raised.number, "acknowledged"), 0) == []


def test_a_doubt_stands_while_it_is_held() -> None:
    desk = AlertDesk(0)
    moved = Known("moved", "dap", "dap1", "seems to have been moved")
    (raised,) = desk.doubt([moved], 1)
    assert (raised.kind, raised.node_id) == ("dap_moved", "dap1")
    assert desk.doubt([moved], 2) == []
    (over,) = desk.doubt([], 3)
    assert (over.number, over.stage) == (raised.number, "resolved")


def test_a_stranger_is_alerted_to() -> None:
    desk = AlertDesk(0)
    noticed = StrangerNoticed(
        event_time_ns=0, sequence=0, role="responder", node_id="r1", words="forged"
    )
    (raised,) = desk.notice(noticed, 5)
    assert (raised.kind, raised.node_id) == ("intruder", "r1")
    assert desk.notice(noticed, 6) == []


def test_what_a_dap_notices_is_of_somebody_here_or_of_the_dap() -> None:
    desk = AlertDesk(0)
    hear(desk, R1, beat(1.0), 1.0)
    told = [
        hear(desk, DAP, StrangerNoticed(
            event_time_ns=0, sequence=0, role="responder", node_id=node_id, words="poses"
        ), 2.0)
        for node_id in ("r1", "r77", "r78")
    ]  # fmt: skip
    assert [[(each.node_id, each.words) for each in one] for one in told] == [
        [("r1", "poses (by dap1)")], [("dap1", "poses (by dap1)")], [],
    ]  # fmt: skip
