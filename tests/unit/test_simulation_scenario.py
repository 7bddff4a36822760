"""Scenario files: the packaged ones, and what each mistake is told."""

from __future__ import annotations

import re
from pathlib import Path

import msgspec
import numpy as np
import pytest

from shared.config import ConfigError
from shared.simulation.legs import Climb, Move, Stand
from shared.simulation.scenario import MISHAPS, SCENARIOS, load_scenario
from shared.simulation.walker import simulate_walk
from tests.simulated_walks import lone_walk

GOOD = """
description = "one walks and sets a DAP down"
plan = "house_of_four_daps"
[daps.dap1]
position_m = [0.0, 1.0, 0.0]
[daps.dap2]
[people.anna]
spread = 0.02
[responders.r1]
person = "anna"
start_m = [0.0, 1.0]
route = [
  { do = "stand", for_s = 5 },
  { do = "move", gait = "walk", to_m = [[0, 10]] },
  { do = "stand", for_s = 5, installs = "dap2" },
]
"""


TEAM = """
[teams.alpha]
members = ["r2", "r1"]
[teams.alpha.every]
start_m = [0.0, 1.0]
route = [{ do = "stand", for_s = 5 }]
"""


@pytest.mark.parametrize("path", sorted(SCENARIOS.glob("*.toml")), ids=lambda path: path.stem)
def test_packaged_scenarios_load_by_name_and_are_whole(path: Path) -> None:
    scenario = load_scenario(path.stem)
    assert msgspec.to_builtins(scenario) == msgspec.to_builtins(load_scenario(str(path)))
    assert {dap_id for dap_id, _ in scenario.installations} == {
        dap_id for dap_id, dap in scenario.daps.items() if dap.position_m is None
    }


@pytest.mark.parametrize(
    ("good", "bad", "told"),
    [
        ("[daps.dap2]\n", "", "installs 'dap2': list it"),
        ("installs = ", "installs_ = ", "unknown key; did you mean 'installs'"),
        (', installs = "dap2"', "", "daps.dap2: give it a position_m, or let one leg"),
        ("[daps.dap2]", "[daps.dap2]\nposition_m=[0, 9, 0]", "has 2"),
        ('person = "anna"', 'person = "ana"', "'ana' is not under people"),
        ("for_s = 5 }", "for_s = 1 }", "begin with a stand"),
        ("start_m", 'floor = "attic"\nstart_m', r"responders.r1.floor: no 'attic' .*'ground'"),
        (
            '{ do = "move"',
            '{ do = "climb", stairs = "main" },\n{ do = "move"',
            r"responders.r1.route\[1\].stairs: no 'main'",
        ),
        (
            '{ do = "move"',
            '{ do = "search", floors = ["attic"] },\n{ do = "move"',
            r"responders.r1.route\[1\].floors: no 'attic'",
        ),
        (
            '{ do = "move"',
            '{ do = "go", to_m = [0, 9] },\n{ do = "move"',
            r"route\[1\].do: the plan has no ways",
        ),
        (
            '{ do = "move"',
            '{ do = "search", rooms = [3, 2] },\n{ do = "move"',
            "rooms: 3 is more than 2",
        ),
        ("[responders.r1]", "[responders.r1]\ncarries = ['d1']", "the plan has no sites"),
        ("[people.anna]", "[faults.r9]\nscale = 2.0\n[people.anna]", "faults.r9: nobody is called"),
        ("[people.anna]", "[faults.dap1]\nscale = 2.0\n[people.anna]", "scale: not of a DAP"),
        ("[people.anna]", "[faults.r1]\nreplays_s = 9\n[people.anna]", "not of a responder"),
        ("[people.anna]", "[faults.r1]\nswapped_with = 'dap1'\n[people.anna]", "'dap1' is no"),
        ("[people.anna]", TEAM + "[people.anna]", "'r1' is there more than once"),
        ('gait = "walk"', 'gait = "hop"', "'hop'"),
        ("start_m", "heading_deg = 1e308\nstart_m", r"responders.r1.heading_deg: .* <= 360.0"),
        ("dap1", "r1", "'r1': a responder and a DAP have it"),
        ("dap1", "post", "'post': is the demo's own"),
        ("responders.r1", "responders.launcher", "'launcher': is the demo's own"),
        ('do = "move"', 'do = "fly"', "'fly'"),
        ("[responders.r1]", "[responders.'r 1']", "matching regex"),
        ('plan = "house_of_four_daps"', 'plan = "shed"', "house_of_four_daps"),
    ],
)
def test_a_mistake_is_told(tmp_path: Path, good: str, bad: str, told: str) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(GOOD, encoding="utf-8")
    load_scenario(str(path))
    assert good in GOOD
    path.write_text(GOOD.replace(good, bad), encoding="utf-8")
    with pytest.raises(ConfigError, match=told):
        load_scenario(str(path))


def test_a_plan_beside_the_scenario_is_found(tmp_path: Path) -> None:
    (tmp_path / "hut.toml").write_text(
        'description = "hut"\nfloors = [{ name = "ground", height_m = 0 }]', encoding="utf-8"
    )
    path = tmp_path / "mine.toml"
    path.write_text(GOOD.replace('"house_of_four_daps"', '"hut.toml"'), encoding="utf-8")
    assert load_scenario(str(path)).building.description == "hut"


def test_the_one_that_the_docs_show_can_be_used(tmp_path: Path) -> None:
    page = (Path(__file__).parents[2] / "docs" / "scenarios.md").read_text()
    shown = re.findall(r"```toml\n(.*?)```", page, re.DOTALL)
    (tmp_path / "flat.toml").write_text(shown[0])
    mine = tmp_path / "mine.toml"
    mine.write_text(shown[1])
    scenario = load_scenario(str(mine))
    assert set(scenario.responders) == {"r1", "r2"}
    for name in scenario.responders:
        assert len(simulate_walk(scenario, name, 1).footfalls) > 10


def test_stairs_must_be_walked_to_before_they_are_climbed() -> None:
    with pytest.raises(ValueError, match=r"stairs 'up' begin at .* let a move end there first"):
        simulate_walk(lone_walk(Climb("up")), "r1", seed=0)
    with pytest.raises(ValueError, match="no stairs 'side'"):
        simulate_walk(lone_walk(Climb("side")), "r1", seed=0)


def test_a_team_goes_in_one_after_another_and_carries_its_own_daps(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    team = TEAM.replace('"r1"', '"r3"')
    team = team.replace("[teams.alpha.every]", "stagger_s = 20\ndaps_each = 2\n"
                        "leader_heading_sd_deg = 2\n[teams.alpha.every]\n"
                        "start_s = 60\nsets_down = 'spaced'")  # fmt: skip
    path.write_text(GOOD + team, encoding="utf-8")
    scenario = load_scenario(str(path))
    assert list(scenario.responders) == ["r1", "r2", "r3"]
    first, second = scenario.responders["r2"], scenario.responders["r3"]
    assert (first.start_s, second.start_s) == (60.0, 80.0)
    assert (first.heading_sd_deg, second.heading_sd_deg) == (2.0, 30.0)
    assert second.carries == ("r3-1", "r3-2")
    assert set(scenario.daps) == {"dap1", "dap2", "r2-1", "r2-2", "r3-1", "r3-2"}
    assert ("r3-2", "r3") in scenario.installations
    path.write_text('description = ""\nplan = "hall"', encoding="utf-8")
    with pytest.raises(ConfigError, match="nobody goes in"):
        load_scenario(str(path))


def test_who_waits_for_others_stands_until_then() -> None:
    waiting = lone_walk(Move("walk", ((10.0, 0.0),)), Stand(2.0, until_s=60.0), Stand(5.0))
    walk = simulate_walk(waiting, "r1", seed=0)
    arrived = int(np.argmax(walk.body.position_m[:, 0] > 9.9))
    assert walk.body.time_s[arrived] < 30.0
    assert walk.body.time_s[-1] == pytest.approx(68.0)


def test_a_mishap_befalls_any_scenario(tmp_path: Path) -> None:
    scenario = load_scenario("offices+clock_ahead+long_strides")
    assert scenario.description == load_scenario("offices").description
    assert scenario.faults.keys() == {"r2", "r3"}
    with pytest.raises(ConfigError, match="long_strides: something is wrong with r2 already"):
        load_scenario("wrong_units+long_strides")
    mine = tmp_path / "mine.toml"
    mine.write_text('description = "Lost"\n[faults.nobody]\nscale = 0.9\n', encoding="utf-8")
    with pytest.raises(ConfigError, match=r"faults\.nobody: nobody is called so"):
        load_scenario(f"offices+{mine}")
    with pytest.raises(ConfigError, match="no_mishap: not packaged; use clock_ahead"):
        load_scenario("offices+no_mishap")


@pytest.mark.parametrize("mishap", sorted(path.stem for path in MISHAPS.glob("*.toml")))
def test_every_mishap_can_befall_a_team(mishap: str) -> None:
    assert load_scenario(f"meeting+{mishap}").faults
