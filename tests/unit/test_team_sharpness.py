"""How far passes and moves scatter is learnt from how far they are off once all is solved."""

from __future__ import annotations

import math
from typing import TypeAlias

import numpy as np
import pytest

from command_post.fusion.team.assembly import AS_TOLD, NO_AXIS, Noise, assemble
from command_post.fusion.team.log import TeamLog
from command_post.fusion.team.settings import TeamSettings
from command_post.fusion.team.sharpness import (
    LEAST_OF_MOVES,
    LEAST_SCALE,
    MOST_OF_MOVES,
    MOST_SCALE,
    learnt_noise,
)
from command_post.fusion.team.solution import NOTHING
from command_post.fusion.team.solving import commit, solve
from shared.messages import DapInstallation, OdometryIncrement, RssiPeak
from tests.stride_world import STRIDE_M, at_ns, installation, stride, track_start
from tests.unit.test_team_tracker import peak_at

SETTINGS = TeamSettings(axis=False)
EAGER = TeamSettings(axis=False, noise_prior_moves=5.0)
LOST = TeamSettings(axis=False, stride_sd_m=20.0)
END_S = 200.0

Said: TypeAlias = tuple[str, OdometryIncrement | DapInstallation | RssiPeak]
"""By whom, and what."""


def to_and_fro(aside_m: float, seed: int = 1, passes: int = 60) -> TeamLog:
    """Return the log of a straight way past known DAPs, each of them ``aside_m`` off it at most.

    The boot is faultless, and so is known to be within centimetres of its way.
    """
    log, chance = TeamLog(), np.random.default_rng(seed)
    log.add_start("r1", track_start(0.0, heading_sd_rad=0.01))
    for k in range(passes):
        log.add_move("r1", stride(2.0 + 2.0 * k, 1.2, 0.0, sequence=k))
        angle, off_m = chance.uniform(0.0, 2.0 * math.pi), aside_m * math.sqrt(chance.uniform())
        place = (1.2 * (k + 1) + off_m * math.cos(angle), off_m * math.sin(angle))
        log.add_dap(f"dap{k}", installation(0.0, None, place))
        log.add_peak(f"dap{k}", peak_at(2.0 + 2.0 * k, "r1", peak_dbm=-42.0))
    return log


def learnt(log: TeamLog, rounds: int = 4) -> float:
    return learnt_all(log, rounds).passes


def learnt_all(log: TeamLog, rounds: int, settings: TeamSettings = SETTINGS) -> Noise:
    before = NOTHING
    for number in range(1, rounds + 1):
        solved = commit(log, at_ns(END_S), before, settings)
        assert solved is not None
        before = solved.solution(number, solved.noise(settings))
    return before.noise


def test_peaks_are_taken_for_no_sharper_than_twice_what_is_told() -> None:
    assert learnt(to_and_fro(0.0)) == LEAST_SCALE
    assert learnt(to_and_fro(0.3)) == pytest.approx(LEAST_SCALE, abs=0.01)


def test_blunt_peaks_are_found_to_be_blunt() -> None:
    scales = [learnt(to_and_fro(aside_m)) for aside_m in (1.2, 2.4, 3.6, 4.8)]
    assert scales == sorted(scales)
    assert scales[0] < 1.1
    assert scales[1] > 1.1
    assert scales[3] > 2.0


def test_what_the_solution_follows_does_not_make_passes_sharp() -> None:
    """A boot that knows nothing of its way goes wherever it passed something."""
    log = to_and_fro(2.4)
    solved = commit(log, at_ns(END_S), NOTHING, LOST)
    assert solved is not None
    assert solved.noise(LOST).passes == pytest.approx(1.0, abs=0.1)

    assert learnt(to_and_fro(60.0)) <= MOST_SCALE


def heard_again(times: int) -> TeamLog:
    """Return the log of one who lingers by each of 20 DAPs, 3.5 m off it, and hears it so often."""
    log, chance = TeamLog(), np.random.default_rng(3)
    log.add_start("r1", track_start(0.0, heading_sd_rad=0.01))
    for k in range(20 * times):
        way_m = 12.0 if k % times == 0 else 0.05
        log.add_move("r1", stride(2.0 + 2.0 * k, way_m, 0.0, sequence=k))
        dap_id = f"dap{k // times}"
        if k % times == 0:
            angle, north_m = chance.uniform(0.0, 2.0 * math.pi), 12.0 * (k // times + 1)
            place = (north_m + 3.5 * math.cos(angle), 3.5 * math.sin(angle))
            log.add_dap(dap_id, installation(0.0, None, place))
        log.add_peak(dap_id, peak_at(2.0 + 2.0 * k, "r1", peak_dbm=-42.0))
    return log


def test_passes_shadowed_alike_make_nobody_seem_sharper() -> None:
    """Four together say no more than one, and are not four that lie half as far off."""
    assert learnt(heard_again(4)) == pytest.approx(learnt(heard_again(1)), rel=0.1)


def test_few_passes_say_little() -> None:
    few, many = learnt(to_and_fro(4.0, passes=3)), learnt(to_and_fro(4.0, passes=60))
    assert 1.0 <= few < 0.7 * many


def test_nobody_passed_anything() -> None:
    log = TeamLog()
    log.add_start("r1", track_start(0.0, heading_sd_rad=0.1))
    solved = solve(log, at_ns(10.0), NOTHING, NO_AXIS, SETTINGS, 5)
    assert solved is not None
    found = learnt_noise(solved.assembled, solved.pose, solved.arrow, SETTINGS)
    assert found == pytest.approx(AS_TOLD, abs=1e-3)


def test_a_scale_blunts_passes_and_nothing_else() -> None:
    log = to_and_fro(0.0, passes=3)
    log.add_dap("own", installation(3.0, "r1", None))
    sharp, blunt = (
        assemble(log, at_ns(END_S), NO_AXIS, Noise(passes=scale), SETTINGS) for scale in (1.0, 3.0)
    )
    assert sharp is not None
    assert blunt is not None
    is_pass = sharp.graph.tie[:, 3] > 0.0
    assert is_pass.sum() == 3
    assert (~is_pass).sum() == 1
    ratio = blunt.graph.tie[:, 2] / sharp.graph.tie[:, 2]
    assert ratio[is_pass] == pytest.approx(3.0)
    assert ratio[~is_pass] == pytest.approx(1.0)
    np.testing.assert_array_equal(blunt.graph.move, sharp.graph.move)


def walked(
    place_times: float, turn_times: float, *, drift_rad_s: float = 0.0, scale: float = 1.0,
    seed: int = 3, strides: int = 180,
) -> list[Said]:  # fmt: skip
    """Return what is said of a straight way past known DAPs, one every six strides.

    Strides scatter by so many times what the settings say, in place and in turn.
    """
    chance, place_m, turn_rad = np.random.default_rng(seed), np.zeros(2), 0.0
    own_m = place_times * (SETTINGS.stride_sd_m + SETTINGS.stride_sd_share * STRIDE_M)
    said: list[Said] = []
    for k in range(strides):
        turn_rad += turn_times * SETTINGS.stride_turn_sd_rad * chance.normal() + drift_rad_s
        place_m[0] += STRIDE_M
        went_m = scale * STRIDE_M * np.array([math.cos(turn_rad), math.sin(turn_rad)])
        north_m, east_m = (went_m + own_m * chance.normal(size=2)).tolist()
        said.append(("r1", stride(1.0 + k, north_m, east_m, sequence=k)))
        if k % 6 == 5:
            dap_id, stands_m = f"dap{k}", (float(place_m[0]), float(place_m[1]))
            said.append((dap_id, installation(0.0, None, stands_m)))
            said.append((dap_id, peak_at(1.0 + k, "r1", peak_dbm=-38.0)))
    return said


def logged(said: list[Said]) -> TeamLog:
    log = TeamLog()
    log.add_start("r1", track_start(0.0, heading_sd_rad=0.01))
    for node_id, message in said:
        if isinstance(message, OdometryIncrement):
            log.add_move(node_id, message)
        elif isinstance(message, RssiPeak):
            log.add_peak(node_id, message)
        else:
            log.add_dap(node_id, message)
    return log


def test_how_far_strides_scatter_is_found_from_where_they_lead() -> None:
    as_told = learnt_all(logged(walked(1.0, 1.0)), 4, EAGER)
    places = learnt_all(logged(walked(4.0, 1.0)), 4, EAGER)
    turns = learnt_all(logged(walked(1.0, 4.0)), 4, EAGER)
    faultless = learnt_all(logged(walked(0.0, 0.0)), 4, EAGER)

    assert 0.7 < as_told.places < 1.2
    assert 0.7 < as_told.turns < 1.2
    assert places.places > 1.25 * as_told.places
    assert turns.turns > 2.0 * as_told.turns
    assert turns.turns > places.turns
    assert places.places > turns.places
    assert LEAST_OF_MOVES <= faultless.places < 0.95 * as_told.places
    assert LEAST_OF_MOVES <= faultless.turns < 0.9 * as_told.turns


def test_strides_are_not_held_to_scatter_without_bounds() -> None:
    wild = learnt_all(logged(walked(60.0, 60.0)), 4)
    assert max(wild.places, wild.turns) <= MOST_OF_MOVES


def test_a_short_way_says_little_of_how_strides_scatter() -> None:
    few = learnt_all(logged(walked(4.0, 4.0, strides=18)), 4)
    many = learnt_all(logged(walked(4.0, 4.0)), 4)
    assert few.places < many.places
    assert few.turns < many.turns


def test_what_lasts_is_not_taken_for_scatter() -> None:
    lasting = walked(0.0, 0.0, drift_rad_s=2.0 * SETTINGS.drift_sd_rad_s, scale=0.97)
    noise = learnt_all(logged(lasting), 4)
    assert noise.places < 1.0
    assert noise.turns < 1.0


def test_what_is_learnt_is_the_same_to_the_bit_in_whatever_order_it_is_heard() -> None:
    said = walked(2.0, 2.0, strides=60)
    order = np.random.default_rng(1).permutation(len(said)).tolist()
    assert learnt_all(logged([said[k] for k in order]), 2) == learnt_all(logged(said), 2)
