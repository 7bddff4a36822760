"""What was wrong in exercises is counted as named, named as something else, or not at all."""

from __future__ import annotations

import io

import numpy as np
import pytest
from rich.console import Console

from command_post.commands.offline import mishaps
from command_post.evaluation.errors import MethodErrors, RunErrors, TrackErrors
from command_post.evaluation.naming import Trial, naming, wrong_things
from command_post.evaluation.score_card import Radii
from command_post.rehearsing.score_table import naming_table
from shared.process import ExitCode
from shared.simulation.scenario import Scenario, load_scenario


@pytest.fixture(scope="module")
def scenario() -> Scenario:
    return load_scenario("offices+two_at_once+swapped_at_first")


def errors(off_m: dict[str, float], daps_m: dict[str, float]) -> RunErrors:
    tracks = {
        name: TrackErrors(np.zeros(1), np.array([m]), np.zeros(1), np.zeros(1), 0.0, None, None,
                          None)
        for name, m in off_m.items()
    }  # fmt: skip
    one = MethodErrors(tracks, np.empty(0), np.empty(0), daps_m)
    return RunErrors(one, one, None)


GOOD = errors({"r1": 1.0, "r2": 1.0, "r3": 1.0, "r4": 1.0}, {"r1-1": 0.5})
BAD = errors({"r1": 2.0, "r2": 9.0, "r3": 5.0, "r4": 9.0}, {"r1-1": 7.0})


def test_what_ought_to_be_named_is_what_is_wrong(scenario: Scenario) -> None:
    told = {(tuple(sorted(each.node_ids)), *each.named_as) for each in wrong_things(scenario)}
    assert told == {(("r3",), "renewed"), (("r1-1",), "moved"), (("r2", "r4"), "swapped")}


def test_each_thing_is_counted_once_in_each_run(scenario: Scenario) -> None:
    told_s = {
        ("doubt_renewed", "r3"): 170.0,
        ("doubt_astray", "r1-1"): 200.0,
        ("doubt_swapped", "r2"): 40.0,
        ("doubt_swapped", "r4"): 60.0,
        ("doubt_clock", "r1"): 90.0,
        ("wrong_clock", "r1"): 10.0,
        ("refused", "r1"): 5.0,
    }
    told = naming(scenario, [Trial(BAD, GOOD, told_s), Trial(BAD, GOOD, {})])
    assert (told.runs, told.things, told.rightly, told.otherwise) == (2, 6, 2, 1)
    assert told.after_s == pytest.approx(40.0)
    assert told.falsely == {"r1 clock": 1}
    assert told.others.wrong == Radii(2.0, 2.0)
    assert told.affected.in_order == Radii(1.0, 1.0)
    assert told.daps.wrong == Radii(7.0, 7.0)


def test_a_dap_that_nobody_set_down_is_not_wrong(scenario: Scenario) -> None:
    never = errors({"r1": 1.0, "r2": 1.0, "r3": 1.0, "r4": 1.0}, {})
    told = naming(scenario, [Trial(never, never, {})])
    assert told.things == 2
    assert told.daps.wrong is None


def test_the_table_says_what_was_named_and_what_else(scenario: Scenario) -> None:
    told = naming(scenario, [Trial(BAD, GOOD, {("doubt_clock", "r1"): 90.0})])
    console = Console(width=200, record=True, file=io.StringIO())
    console.print(naming_table("offices", {"two_at_once": told}))
    (row,) = (line for line in console.export_text().splitlines() if "two_at_once" in line)
    cells = [cell.strip() for cell in row.strip("│").split("│")]
    assert cells[:4] == ["two_at_once", "0 of 3", "", "r1 clock (1)"]
    assert cells[4:] == ["1.0/1.0 → 9.0/9.0", "1.0/1.0 → 2.0/2.0", "0.5/0.5 → 7.0/7.0"]


def test_a_mishap_that_there_is_not_is_refused_before_anything_is_run() -> None:
    assert mishaps(scenario=["offices"], mishap=["no_such"]) == ExitCode.USAGE
