"""Those alone whom suspicions are about tell which are worth solving a whole crew for."""

from __future__ import annotations

import math
from functools import cache

import pytest

from command_post.fusion.team.assembly import AS_TOLD
from command_post.fusion.team.doubts import PRICE
from command_post.fusion.team.log import TeamLog
from command_post.fusion.team.screening import TURNS_RAD, Screen
from command_post.fusion.team.settings import TeamSettings
from command_post.fusion.team.solution import NOTHING
from command_post.fusion.team.solving import commit
from command_post.fusion.team.suspicions import Suspicion, SuspicionKind
from shared.messages import DapInstallation, OdometryIncrement, RssiPeak, TrackStart
from tests.patrol_world import Faults, patrol
from tests.stride_world import at_ns

SETTINGS = TeamSettings()
TURNED_S, UNTIL_S = 150.0, 210.0
TURNED = Faults(since_s=TURNED_S, renewed=("r3", math.radians(110.0)))
SWAPPED = Faults(since_s=TURNED_S, swapped=("r1", "r3"))
LATE = Faults(ahead_s=("r3", 3.0))


def heard(faults: Faults | None) -> TeamLog:
    log = TeamLog()
    for node_id, message in patrol(1, faults).heard:
        if message.event_time_ns > at_ns(UNTIL_S):
            break
        match message:
            case TrackStart():
                log.add_start(node_id, message)
            case OdometryIncrement():
                log.add_move(node_id, message)
            case RssiPeak():
                log.add_peak(node_id, message)
            case DapInstallation():
                log.add_dap(node_id, message)
    return log


@cache
def screen(faults: Faults | None) -> Screen:
    log, until_ns = heard(faults), at_ns(UNTIL_S)
    solved = commit(log, until_ns, NOTHING, SETTINGS)
    assert solved is not None
    return Screen(log, solved, until_ns, AS_TOLD, SETTINGS)


def turns_deg(
    of: Screen, kind: SuspicionKind, responder_id: str, since_s: float = 0.0, ahead_s: float = 0.0
) -> list[int]:
    suspicion = Suspicion(kind, "responder", responder_id, at_ns(since_s), ahead_s=ahead_s)
    return [round(math.degrees(turn)) for turn in of.turns_worth(suspicion, PRICE[kind])]


def test_a_unit_that_began_anew_is_worth_a_trial_for_each_way_that_it_may_be_turned() -> None:
    assert len(turns_deg(screen(TURNED), "renewed", "r3", TURNED_S)) == 1


@pytest.mark.parametrize("ahead_s", [3.0, -3.0])
def test_a_clock_is_worth_a_trial_if_it_is_off_that_way(ahead_s: float) -> None:
    is_worth = bool(turns_deg(screen(LATE), "clock", "r3", ahead_s=ahead_s))
    assert is_worth == (ahead_s > 0.0)


@pytest.mark.parametrize(
    ("kind", "since_s", "ahead_s"),
    [("renewed", TURNED_S, 0.0), ("clock", 0.0, 3.0), ("scale", 0.0, 0.0), ("misplaced", 0.0, 0.0)],
)
def test_what_explains_nothing_is_worth_none(
    kind: SuspicionKind, since_s: float, ahead_s: float
) -> None:
    assert turns_deg(screen(None), kind, "r2", since_s, ahead_s) == []


@pytest.mark.parametrize("faults", [None, SWAPPED])
def test_swapped_radios_are_worth_a_trial_if_both_fit_better_so(faults: Faults | None) -> None:
    swapped = Suspicion("swapped", "responder", "r1", at_ns(TURNED_S), "r3")
    turns_rad = screen(faults).turns_worth(swapped, PRICE["swapped"])
    assert turns_rad == (TURNS_RAD if faults else ())


def test_what_is_not_of_responders_alone_is_always_tried() -> None:
    astray = Suspicion("astray", "dap", "dap4", 0)
    assert screen(None).turns_worth(astray, PRICE["astray"]) == TURNS_RAD
