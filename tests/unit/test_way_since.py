"""The way since somebody was solved, kept up move by move, is to the bit what all of it gives."""

from __future__ import annotations

import math
import pickle

import numpy as np
import pytest
from msgspec.structs import replace

from command_post.fusion.team.log import END_OF_TIME_NS
from command_post.fusion.team.move_log import DOWN, DOWN_M2, EAST, NORTH, MoveLog, Moves
from command_post.fusion.team.settings import TeamSettings
from command_post.fusion.team.unseen import BEFORE, unseen_before
from command_post.fusion.team.way_since import Ways, WaySince
from shared.messages import OdometryIncrement
from tests.stride_world import STRIDE_S, at_ns, stride

SETTINGS = TeamSettings()
SUMS = ("north_m", "east_m", "down_m", "own_m2", "place_m2", "turn_rad2", "down_m2")
STRIDES = 60


def walk(seed: int) -> list[OdometryIncrement]:
    """Return strides of which some are lost, some go unnoticed and some follow a pause."""
    chance = np.random.default_rng(seed)
    told, time_s, sequence = [], 2.0, 0
    for _ in range(STRIDES):
        time_s += STRIDE_S * chance.uniform(0.98, 1.02) + (chance.random() < 0.1) * 1.7
        sequence += 1
        kind = chance.random()
        if kind < 0.2:
            sequence -= kind < 0.1
            continue
        north_m, east_m, down_m = chance.normal((1.2, 0.0, 0.0), 0.2).tolist()
        covariance = tuple(chance.uniform(0.0, 1e-3, 10).tolist())
        one = stride(time_s, north_m, east_m, sequence=sequence, d_down_m=down_m)
        told.append(replace(one, covariance=covariance))
    return told


def logged(told: list[OdometryIncrement]) -> MoveLog:
    log = MoveLog()
    for each in told:
        assert log.add(each)
    return log


def sums(way: WaySince) -> list[float]:
    return [math.fsum(getattr(way, name)) for name in SUMS] + [way.count, way.end_ns]


def sums_by_arrays(log: MoveLog, since_ns: int) -> list[float]:
    """Return the same from the log as a whole, by what is supposed of all moves at once."""
    end_ns, start_ns, sequence, values = log.until(END_OF_TIME_NS)
    first = log.count_until(since_ns)
    begin = max(first - BEFORE, 0)
    every = Moves(end_ns[begin:], start_ns[begin:], sequence[begin:], values[begin:])
    unseen = unseen_before(every, SETTINGS)
    since, behind = values[first:], slice(first - begin, None)
    way_m = since[:, [NORTH, EAST, DOWN]] + unseen.way_m[behind]
    stride_m = np.hypot(since[:, NORTH], since[:, EAST])
    own_m2 = (SETTINGS.stride_sd_m + SETTINGS.stride_sd_share * stride_m) ** 2
    columns = [
        *way_m.T, own_m2, unseen.place_m2[behind], unseen.turn_rad2[behind],
        since[:, DOWN_M2] + unseen.down_m2[behind],
    ]  # fmt: skip
    last_ns = int(end_ns[-1]) if len(since) else since_ns
    return [math.fsum(column.tolist()) for column in columns] + [len(since), last_ns]


@pytest.mark.parametrize("since", [0.0, 2.5, 20.0, 500.0])
@pytest.mark.parametrize("seed", range(3))
def test_one_by_one_they_come_to_what_all_at_once_come_to(seed: int, since: float) -> None:
    log, ways = MoveLog(), Ways(SETTINGS)
    for each in walk(seed):
        log.add(each)
        found, whole = sums(ways.of("r1", log, at_ns(since))), sums_by_arrays(log, at_ns(since))
        assert found[3] == pytest.approx(whole[3], rel=1e-12)
        assert found[:3] + found[4:] == whole[:3] + whole[4:]


@pytest.mark.parametrize("late", [1, 7, 30])
def test_one_that_comes_late_leaves_no_trace(late: int) -> None:
    told, ways = walk(4), Ways(SETTINGS)
    log = logged(told[:late] + told[late + 1 :])
    short = sums(ways.of("r1", log, at_ns(2.0)))
    assert log.add(told[late])
    whole = sums(ways.of("r1", log, at_ns(2.0)))
    assert short != whole == sums(Ways(SETTINGS).of("r1", logged(told), at_ns(2.0)))


def test_it_is_the_same_of_a_log_that_was_kept_and_of_one_that_forgot() -> None:
    log = logged([stride(k * STRIDE_S, 1.0, 0.1 * k, sequence=k) for k in range(1000)])
    ways, since_ns = Ways(SETTINGS), at_ns(990.0 * STRIDE_S)
    before = sums(ways.of("r1", log, since_ns))
    kept_ways, kept_log = pickle.loads(pickle.dumps((ways, log)))  # noqa: S301
    assert sums(kept_ways.of("r1", kept_log, since_ns)) == before
    log.forget(at_ns(600.0 * STRIDE_S))
    assert len(log) < 1000
    assert log.add(stride(1000.0 * STRIDE_S, 1.0, 0.0, sequence=1000))
    after = ways.of("r1", log, since_ns)
    assert after.count == before[-2] + 1
    assert after.north_m[-2:] == [1.0, 1.0]
