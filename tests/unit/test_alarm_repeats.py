"""What is said again of alarms, and when it has been said often enough."""

from __future__ import annotations

from collections.abc import Mapping

from edge_agent.alarm_repeats import AlarmRepeats
from edge_agent.alarms import AlarmEvent
from shared.messages import AlarmKind, AlarmPhase
from shared.units import NS_PER_S

START_NS = 10**18


def event(at_s: float, phase: AlarmPhase, kind: AlarmKind = "motionless") -> AlarmEvent:
    return AlarmEvent(START_NS + round(at_s * NS_PER_S), kind, phase, 1.0, "because")


def said(raised: Mapping[float, AlarmEvent], until_s: int) -> list[tuple[float, AlarmEvent]]:
    """Return what is said, and when, of alarms ``raised`` at whole tenths of a second."""
    repeats, told = AlarmRepeats(), []
    for tenth in range(10 * until_s):
        events = [raised[tenth / 10]] if tenth / 10 in raised else []
        now_ns = START_NS + tenth * NS_PER_S // 10
        told += [(tenth / 10, one) for one in repeats.due(events, now_ns)]
    return told


def test_an_alarm_that_stands_is_said_every_five_seconds() -> None:
    raised = event(3.0, "alarm")
    assert said({3.0: raised}, 20) == [(3.0, raised), (8.0, raised), (13.0, raised), (18.0, raised)]


def test_that_an_alarm_is_over_is_said_three_times() -> None:
    raised, over = event(3.0, "alarm"), event(4.5, "cancelled")
    told = said({3.0: raised, 4.5: over}, 60)
    assert told == [(3.0, raised), (4.5, over), (6.5, over), (8.5, over)]


def test_an_alarm_raised_again_is_not_said_to_be_over() -> None:
    over, again = event(1.0, "cancelled"), event(2.0, "pre_alarm")
    assert said({1.0: over, 2.0: again}, 8) == [(1.0, over), (2.0, again), (7.0, again)]


def test_each_kind_is_said_by_itself() -> None:
    over, fall = event(1.0, "cancelled"), event(1.5, "alarm", "fall")
    told = said({1.0: over, 1.5: fall}, 7)
    assert told == [(1.0, over), (1.5, fall), (3.0, over), (5.0, over), (6.5, fall)]


def test_a_clock_set_back_says_all_again() -> None:
    repeats, raised = AlarmRepeats(), event(3.0, "alarm")
    assert repeats.due([raised], START_NS) == [raised]
    assert repeats.due([], START_NS - NS_PER_S) == [raised]
    assert repeats.due([], START_NS) == []
