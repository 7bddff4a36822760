"""Who is one crew; and that crews leave no trace of the order of arrival either."""

from __future__ import annotations

from collections.abc import Iterable
from copy import deepcopy
from itertools import pairwise

import numpy as np
import pytest
from msgspec import structs

from command_post.fusion.interface import Afterwards
from command_post.fusion.team import lines, making
from command_post.fusion.team.alone import commit_of_crowd
from command_post.fusion.team.crews import EVERYBODY, Bonds, crews_at
from command_post.fusion.team.log import ANYWHERE, Installed, TeamLog
from command_post.fusion.team.settings import TeamSettings
from command_post.fusion.team.solution import Solution
from command_post.fusion.team.solving import Solved
from command_post.fusion.team.team_tracker import TeamTracker
from shared.messages import OdometryIncrement, RssiPeak
from shared.units import NS_PER_S
from tests.benchmarks.crowd import START_NS, Said, crowd
from tests.unit.test_team_tracker import give

SETTINGS = TeamSettings(crew_most=4)
MINUTES = 0.8
END_NS = START_NS + 62 * NS_PER_S


def bonds_of(began: Iterable[str], passed: Iterable[tuple[str, str]]) -> Bonds:
    bonds = Bonds()
    for number, who in enumerate(began):
        bonds.note_began(who, number)
    for number, (who, dap_id) in enumerate(passed):
        bonds.note_passed(who, dap_id, 100 + number)
    return bonds


def members(
    bonds: Bonds, daps: dict[str, list[Installed]], until_ns: int = 1000
) -> list[tuple[str, ...]]:
    return [crew.members for crew in crews_at(bonds, daps, until_ns, SETTINGS).crews]


SET_DOWN = {"d": [Installed(50, "a", None)], "e": [Installed(50, "f", None)]}


def test_few_are_one_crew_whatever_they_share() -> None:
    crews = crews_at(bonds_of("abcd", []), {}, 1000, SETTINGS)
    assert [crew.leader for crew in crews.crews] == [EVERYBODY]
    assert crews.crews[0].members == tuple("abcd")


def test_who_passed_the_same_dap_is_one_crew_as_large_as_may_be() -> None:
    bonds = bonds_of("abcdefg", [(who, "d") for who in "abcdg"])
    assert members(bonds, SET_DOWN) == [tuple("abcd"), ("e",), ("f",), ("g",)]
    assert members(bonds, SET_DOWN, 102) == [tuple("abc"), ("d",), ("e",), ("f",), ("g",)]


def test_those_who_find_a_crew_full_are_one_of_their_own() -> None:
    bonds = bonds_of("abcdefg", [(who, "d") for who in "abcdfg"])
    assert members(bonds, SET_DOWN) == [tuple("abcd"), ("e",), ("f", "g")]


def test_a_dap_whose_place_was_told_makes_no_crew() -> None:
    told = {"d": [Installed(50, None, ANYWHERE)]}
    bonds = bonds_of("abcde", [(who, "d") for who in "abcde"])
    assert members(bonds, told) == [(each,) for each in "abcde"]


def test_who_met_is_one_crew_and_so_is_who_sets_down_what_another_passes() -> None:
    bonds = bonds_of("abcdef", [("b", "e")])
    bonds.note_met("d", "a", 200)
    assert members(bonds, SET_DOWN) == [("a", "d"), ("b", "f"), ("c",), ("e",)]
    assert crews_at(bonds, SET_DOWN, 1000, SETTINGS).owner == {"d": "a", "e": "b"}


@pytest.fixture(scope="module")
def said() -> list[Said]:
    """What three crews of three say, one of whom passes a DAP of another crew."""
    said = list(crowd(3, 3, MINUTES, 2.0, seed=3))
    passed = next(
        each.message for each in said
        if isinstance(each.message, RssiPeak) and each.message.responder_id == "r1-2"
    )  # fmt: skip
    said.append(Said("dap0-0", structs.replace(passed, event_time_ns=passed.event_time_ns + 1)))
    return sorted(said, key=lambda each: each.message.event_time_ns)


def held(tracker: TeamTracker) -> tuple[object, ...]:
    return dict(tracker.estimates), dict(tracker.daps)


def after(tracker: TeamTracker, said: Iterable[Said]) -> tuple[object, ...]:
    for node_id, message in said:
        give(tracker, node_id, message)
    return held(tracker)


def closing() -> Iterable[Said]:
    """Strides that let every crew be solved once more."""
    for number in range(24):
        stride = OdometryIncrement(
            event_time_ns=END_NS + number * NS_PER_S, start_time_ns=END_NS, sequence=9000 + number,
            d_north_m=0.0, d_east_m=0.0, d_down_m=0.0, d_heading_rad=0.0, heading_rad=0.0,
            covariance=(0.01, 0.0, 0.0, 0.0, 0.01, 0.0, 0.0, 0.01, 0.0, 0.001), mount="boot",
        )  # fmt: skip
        yield Said("r0-0", stride)


def test_the_order_of_arrival_leaves_no_trace_to_the_bit(said: list[Said]) -> None:
    chance = np.random.default_rng(5)
    in_order = after(TeamTracker(SETTINGS), [*said, *closing()])
    late = sorted(
        said,
        key=lambda each: each.message.event_time_ns + (20 * NS_PER_S) * (each.node_id == "r1-0"),
    )
    scattered = [said[at] for at in chance.permutation(len(said))]
    assert after(TeamTracker(SETTINGS), [*late, *closing()]) == in_order
    assert after(TeamTracker(SETTINGS), [*scattered, *closing()]) == in_order


def test_kept_midway_and_taken_up_it_goes_on_to_the_bit(said: list[Said]) -> None:
    times_ns = [each.message.event_time_ns for each in said if isinstance(each.message, RssiPeak)]
    # Everybody has taken a stride since the last pass.
    gap_ns = next(
        one for one, other in pairwise(times_ns[len(times_ns) // 2 :]) if other - one > NS_PER_S
    )
    middle = sum(each.message.event_time_ns < gap_ns + 0.9 * NS_PER_S for each in said)
    whole = TeamTracker(SETTINGS)
    after(whole, said[:middle])
    resumed = deepcopy(whole)
    assert held(resumed) == held(whole)
    assert after(resumed, [*said[middle:], *closing()]) == after(
        whole, [*said[middle:], *closing()]
    )
    assert_same(resumed.afterwards(), whole.afterwards())


def assert_same(one: Afterwards, other: Afterwards) -> None:
    assert one.tracks.keys() == other.tracks.keys()
    assert one.daps == other.daps
    assert len(one.tracks) == 9
    for name, track in one.tracks.items():
        assert all(map(np.array_equal, track, other.tracks[name]))


def test_a_late_event_has_only_its_own_crew_solved_again(
    said: list[Said], monkeypatch: pytest.MonkeyPatch
) -> None:
    solved: list[tuple[int, tuple[str, ...]]] = []
    # Three commits of its own crew are made at once, of all crews they would not be.
    monkeypatch.setattr(lines, "CROWD_WORK", 9)
    tracker = TeamTracker(SETTINGS)
    given = [each for each in said if each.message.event_time_ns < START_NS + 45 * NS_PER_S]
    after(tracker, given)

    def noted(
        log: TeamLog, time_ns: int, before: Solution, settings: TeamSettings
    ) -> Solved | None:
        solved.append((time_ns, tuple(log.responders)))
        return commit_of_crowd(log, time_ns, before, settings)

    monkeypatch.setattr(making, "commit_of_crowd", noted)
    moves = [each.message for each in given if each.node_id == "r2-1"]
    old = next(each for each in moves if each.event_time_ns > START_NS + 22 * NS_PER_S)
    late = structs.replace(old, event_time_ns=old.event_time_ns + 1)
    after(tracker, [Said("r2-1", late), *said[len(given) :]])
    last_ns = given[-1].message.event_time_ns
    again = {crew for time_ns, crew in solved if time_ns <= last_ns}
    assert again == {("r2-0", "r2-1", "r2-2")}
    assert len({crew for _, crew in solved}) == 3
    assert len(solved) == len(set(solved))
