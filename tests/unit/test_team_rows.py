"""The rows of the team's graph that kernels write are to the bit what arrays say of them."""

from __future__ import annotations

import math

import numpy as np
import pytest
from msgspec import structs

from command_post.fusion.team.assembly import AS_TOLD, UNKNOWN_TURN_SD_RAD, Noise, _moves
from command_post.fusion.team.chain import Chain, chain_of, straight_moves
from command_post.fusion.team.graph import FIRST_UNIT, PLACE_DOF, TURN_DOF
from command_post.fusion.team.height_assembly import LEAST_SD_M, _rises
from command_post.fusion.team.log import END_OF_TIME_NS, ResponderLog, Start
from command_post.fusion.team.misfits import _worst_bend, robust_cost
from command_post.fusion.team.move_log import DOWN, DOWN_M2, EAST, NORTH, PLACE_M2, TURN_RAD2
from command_post.fusion.team.residuals import longer, off_move, squared_over
from command_post.fusion.team.settings import TeamSettings
from command_post.fusion.team.solution import laid_out
from command_post.fusion.team.unheard import Unheard
from command_post.fusion.team.unseen import unseen_before
from shared.units import NS_PER_S
from tests.stride_world import STRIDE_S, at_ns, stride

SETTINGS = TeamSettings()
STRIDES = 120
SEEDS = range(3)


def heard(seed: int) -> ResponderLog:
    """Return a way of three units, with strides lost, pauses, and a unit begun amid silence."""
    chance = np.random.default_rng(seed)
    log, time_s, sequence = ResponderLog(), 2.0, 0
    log.starts = [Start(at_ns(time_s), 0, 0.1, None)]
    for k in range(STRIDES):
        time_s += STRIDE_S + (chance.random() < 0.1) * chance.uniform(0.0, 9.0)
        sequence += 1 + int(chance.random() < 0.1)
        if k in {40, 80}:
            # One as the move before ends, one later.
            begun_ns = (
                at_ns(time_s - STRIDE_S)
                if k == 80
                else int(log.moves.until(END_OF_TIME_NS).end_ns[-1])
            )
            log.starts.append(Start(begun_ns, k, 0.1, None, is_loose=k == 80))
        north_m, east_m, down_m = chance.normal((1.2, 0.0, 0.0), 0.2).tolist()
        one = stride(time_s, north_m, east_m, sequence=sequence, d_down_m=down_m)
        covariance = tuple(chance.uniform(0.0, 1e-3, 10).tolist())
        log.moves.add(structs.replace(one, covariance=covariance))
    return log


def chain(seed: int) -> Chain:
    found = chain_of("r1", heard(seed), END_OF_TIME_NS, SETTINGS)
    assert found is not None
    return found


def nodes_of(chain: Chain, seed: int) -> np.ndarray:
    chosen = np.random.default_rng(seed).choice(chain.time_ns.size, 40, replace=False)
    ends = np.array([0, chain.time_ns.size - 1])
    return np.unique(np.concatenate([chosen, ends, chain.links, chain.links - 1]))


@pytest.mark.parametrize("seed", SEEDS)
def test_stances_are_beginnings_and_moves_in_the_order_of_time_summed_up(seed: int) -> None:
    log = heard(seed)
    found, moves = chain(seed), log.moves.until(END_OF_TIME_NS)
    begins_ns = np.array([each.time_ns for each in log.starts])
    order = np.argsort(np.concatenate([begins_ns, moves.end_ns]), kind="stable")
    last = np.searchsorted(moves.end_ns, begins_ns, side="right") - 1
    silent_s = np.where(last >= 0, begins_ns - moves.end_ns[last], 0) / NS_PER_S
    gone_m2 = SETTINGS.restart_sd_m**2 + (SETTINGS.restart_speed_m_s * silent_s) ** 2
    gone_m2[0] = 0.0
    unseen, values = unseen_before(moves, SETTINGS), moves.values
    length_m = np.hypot(values[:, NORTH], values[:, EAST])
    own_m2 = (SETTINGS.stride_sd_m + SETTINGS.stride_sd_share * length_m) ** 2
    told_rad2 = SETTINGS.told_turn_factor**2 * values[:, TURN_RAD2]
    rows = np.column_stack([
        values[:, NORTH] + unseen.way_m[:, 0],
        values[:, EAST] + unseen.way_m[:, 1],
        length_m + np.hypot(unseen.way_m[:, 0], unseen.way_m[:, 1]),
        values[:, PLACE_M2] + own_m2 + unseen.place_m2,
        told_rad2 + SETTINGS.stride_turn_sd_rad**2 + unseen.turn_rad2,
        values[:, DOWN] + unseen.way_m[:, 2],
        values[:, DOWN_M2] + unseen.down_m2,
    ])  # fmt: skip
    begun = np.zeros((3, 7))
    begun[:, 3], begun[:, 6] = gone_m2, gone_m2 * SETTINGS.restart_climb_share**2
    sums = np.cumsum(np.concatenate([begun, rows])[order], axis=0)
    of_both = np.column_stack([found.way_m, found.length_m, found.variance, found.rise])
    assert (of_both == sums).all()
    assert (found.time_ns == np.concatenate([begins_ns, moves.end_ns])[order]).all()
    assert (found.begin_ns == np.concatenate([begins_ns, unseen.since_ns])[order]).all()
    unit = np.concatenate([np.arange(3), np.zeros(STRIDES, np.int64)])[order]
    assert (found.unit == np.maximum.accumulate(unit)).all()
    assert (found.links == np.flatnonzero(order < 3)[1:]).all()
    assert found.links.size == 2
    assert unseen.place_m2.any()


def test_what_others_tell_of_who_is_silent_is_a_stance_behind_what_ends_then() -> None:
    log = heard(0)
    plain, moves = chain(0), log.moves.until(END_OF_TIME_NS)
    told_ns = np.array([int(moves.end_ns[20]), int(moves.end_ns[-1]) + 5 * NS_PER_S])
    found = chain_of("r1", log, END_OF_TIME_NS, SETTINGS, Unheard(told_ns, np.array([3.0, 4.0])))
    assert found is not None
    assert found.time_ns[found.unheard].tolist() == told_ns.tolist()
    assert (found.begin_ns[found.unheard] == told_ns - 1).all()
    others = np.setdiff1d(np.arange(found.time_ns.size), found.unheard)
    assert (found.time_ns[others] == plain.time_ns).all()
    assert (np.delete(found.unit, found.unheard) == plain.unit).all()
    assert found.links.tolist() == [int(others[link]) for link in plain.links]
    gone = np.diff(np.column_stack([found.way_m, found.length_m, found.variance]), axis=0)
    rows = gone[found.unheard - 1]
    assert np.allclose(rows, [[0.0, 0.0, 3.0, 9.0, 0.0], [0.0, 0.0, 4.0, 16.0, 0.0]], atol=1e-9)
    rise = np.diff(found.rise, axis=0)[found.unheard - 1]
    assert np.allclose(rise[:, 1], SETTINGS.restart_climb_share**2 * np.array([9.0, 16.0]))
    nodes = np.unique(np.concatenate([[0], found.leaps - 1, found.leaps]))
    leap, _ = _moves(found, nodes, 0, 0, Noise(1.0, 1.3, 0.7))
    assert leap[-1, 3] == pytest.approx(4.0)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("noise", [AS_TOLD, Noise(1.0, 1.3, 0.7)])
def test_moves_from_node_to_node(seed: int, noise: Noise) -> None:
    walked = chain(seed)
    nodes = nodes_of(walked, seed)
    found, at = _moves(walked, nodes, 7, 5, noise)
    one, other = nodes[:-1], nodes[1:]
    place_m2, turn_rad2 = (walked.variance[other] - walked.variance[one]).T
    length_m = walked.length_m[other] - walked.length_m[one]
    sd_m = noise.places * (np.sqrt(place_m2) + 0.29 * length_m * np.sqrt(turn_rad2))
    sd_rad = noise.turns * np.sqrt(turn_rad2)
    link = np.searchsorted(other, walked.links)
    sd_m[link], sd_rad[link] = np.sqrt(place_m2[link]), UNKNOWN_TURN_SD_RAD
    rows = np.column_stack([
        walked.way_m[other] - walked.way_m[one],
        (walked.time_ns[other] - walked.time_ns[one]) / NS_PER_S,
        np.maximum(sd_m, 0.01), np.maximum(sd_rad, 1e-4),
    ])  # fmt: skip
    assert (found == rows).all()
    assert (at[:, 0] == 7 + np.arange(len(one))).all()
    assert (at[:, 1] == FIRST_UNIT + 2 * (5 + walked.unit[other])).all()
    down_m, variance_m2 = np.diff(walked.rise[nodes], axis=0).T
    sd_m = np.maximum(np.sqrt(variance_m2), LEAST_SD_M)
    assert (_rises(walked.rise, nodes) == np.column_stack([down_m, sd_m])).all()


@pytest.mark.parametrize("seed", SEEDS)
def test_straight_moves_of_held_units_and_their_directions(seed: int) -> None:
    walked = chain(seed)
    nodes = nodes_of(walked, seed)
    held = {walked.unit_name(0), walked.unit_name(2)}
    found, direction_rad = straight_moves(walked, nodes, held, SETTINGS)
    way_m = np.diff(walked.way_m[nodes], axis=0)
    straight_m = np.sqrt(way_m[:, 0] ** 2 + way_m[:, 1] ** 2)
    is_straight = straight_m >= SETTINGS.straight_share * np.diff(walked.length_m[nodes])
    is_held = walked.unit[nodes[1:]] != 1
    expected = np.flatnonzero(is_straight & is_held & (straight_m > SETTINGS.straight_least_m))
    assert found.tolist() == expected.tolist()
    assert 0 < found.size < is_held.sum()
    assert direction_rad.tolist() == [math.atan2(east, north) for north, east in way_m[found]]


@pytest.mark.parametrize("seed", SEEDS)
def test_the_worst_bend_is_the_first_that_costs_most(seed: int) -> None:
    chance = np.random.default_rng(seed)
    move = np.abs(chance.normal(size=(30, 5))) + 0.01
    move_at = np.column_stack([np.arange(4, 34), 2 + 2 * chance.integers(0, 3, (30, 2))])
    pose, arrow = chance.normal(size=(40, 3)), chance.normal(size=12)
    off = np.diff(pose[4:35, 2]) - arrow[move_at[:, 1] + 1] * move[:, 2]
    costs = [robust_cost(each * each, TURN_DOF, 1.0) for each in (off / move[:, 4]).tolist()]
    worst = max(range(30), key=lambda row: costs[row])
    unit_sd = np.tile([0.03, 0.001], 5)
    leaps = []
    for row, (node, scale, _) in enumerate(move_at.tolist()):
        _, _, north_m, east_m = off_move(move, row, pose, node, 1.0 + arrow[scale])
        sd_m = float(move[row, 3]) * longer(unit_sd, arrow, scale)
        leaps.append(robust_cost(squared_over(north_m, east_m, sd_m), PLACE_DOF, 2.0))
    at, cost, leap_cost = _worst_bend(move, move_at, unit_sd, pose, arrow)
    assert (at, cost) == (worst, costs[worst])
    assert leap_cost == pytest.approx(max(leaps))
    assert _worst_bend(move[:0], move_at[:0], unit_sd, pose, arrow) == (-1, 0.0, 0.0)


def test_a_way_is_laid_out_as_plain_code_lays_it() -> None:
    chance = np.random.default_rng(4)
    pose, way_m = chance.normal(size=3), chance.normal(size=(20, 2))
    plain = laid_out.py_func  # type: ignore[attr-defined]
    assert (laid_out(pose, 0.7, way_m) == plain(pose, 0.7, way_m)).all()
