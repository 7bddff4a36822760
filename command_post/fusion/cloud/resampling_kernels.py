"""The compiled filter's resampling: particles drawn anew by weight. Meaning: cloud_plain.py."""

from __future__ import annotations

import math

import numpy as np

from command_post.fusion.cloud.lane_arithmetic import (
    ONE,
    ZERO,
    across,
    exponential,
    f32,
    i32,
    random_bits,
    u32,
)
from command_post.fusion.cloud.layout import (
    BLOCK,
    COSINE,
    DRIFT,
    EAST,
    LANES,
    LOG_SCALE,
    NORTH,
    OFFSET,
    SCALE,
    SINE,
    SUM_LANES,
    WEIGHT,
    Indices,
    Lanes,
)
from command_post.fusion.cloud.noise import NORMAL, two_places
from shared.compiled import compiled

_RESAMPLING = u32(0x9E3779B9)
_BITS_30 = f32(2.0**30)
_DRIFT_SQUARED, _SCALE, _SCALE_SQUARED = (SUM_LANES * row for row in range(1, 4))


@compiled
def resample(cloud: Lanes, kept: np.float32, key_low: np.uint32, key_high: np.uint32) -> None:
    """Draw particles anew, systematically by weight; all weigh alike then.

    Who is drawn stays, and copies of who is drawn more often take the places of who is not.
    """
    key_low = u32(key_low ^ _RESAMPLING)
    count = cloud.size // BLOCK * LANES
    vacant, copied = np.empty(count + 1, np.int32), np.empty(count + 2, np.int32)
    vacancies = _draw(cloud, vacant, copied, random_bits(u32(0xFFFFFFFF), key_low, key_high))
    for i in range(vacancies):
        to, of = vacant[i], copied[i]
        cloud[to + NORTH], cloud[to + EAST] = cloud[of + NORTH], cloud[of + EAST]
        cloud[to + OFFSET], cloud[to + DRIFT] = cloud[of + OFFSET], cloud[of + DRIFT]
        cloud[to + COSINE], cloud[to + SINE] = cloud[of + COSINE], cloud[of + SINE]
        cloud[to + LOG_SCALE] = cloud[of + LOG_SCALE]
    _loosen(cloud, kept, key_low, key_high)


@compiled
def _draw(cloud: Lanes, vacant: Indices, copied: Indices, bits: np.uint32) -> int:
    """Write where those lie that are not drawn, and what takes their places; return how many.

    Weights become whole numbers, that no rounding may add up. Along their running sum stand as many
    marks as particles, evenly, the first by chance; who has a mark is drawn. One or two more are
    written than need be, which are the next one's to write over.
    """
    count = copied.size - 2
    total = 0
    for block in range(count // LANES):
        o = block * BLOCK + WEIGHT
        for lane in range(LANES):
            share = i32(cloud[o + lane] * _BITS_30)
            cloud[o + lane] = f32(share)
            total += int(share)
    spacing = total // count
    before_first = spacing - ((int(bits) * spacing) >> 32)
    marks_per_unit = 1.0 / spacing
    reached = mark = vacancies = copies = 0
    for block in range(count // LANES):
        o = block * BLOCK
        for lane in range(LANES):
            reached += int(cloud[o + WEIGHT + lane])
            following = min(int((reached + before_first) * marks_per_unit), count)
            vacant[vacancies] = copied[copies] = copied[copies + 1] = o + lane
            vacancies += following == mark
            more = max(following - mark - 1, 0)
            for further in range(copies + 2, copies + more):
                copied[further] = o + lane
            copies += more
            mark = following
    return vacancies


@compiled
def _loosen(cloud: Lanes, kept: np.float32, key_low: np.uint32, key_high: np.uint32) -> None:
    """Weigh all alike, and let copies differ in drift and scale, which no stride loosens much.

    Each is drawn to the mean by ``kept`` and scattered by what that takes from the spread, so that
    mean and variance stay (Liu and West 2001, section 10.3).
    """
    count = cloud.size // BLOCK * LANES
    weight = ONE / f32(count)
    scatter = f32(math.sqrt(ONE - kept * kept))
    sums = np.zeros(4 * SUM_LANES, np.float32)
    for block in range(count // LANES):
        o = block * BLOCK
        for lane in range(SUM_LANES):
            drift = drift_squared = scale = scale_squared = ZERO
            for at in range(o + lane, o + lane + LANES, SUM_LANES):
                drift += cloud[at + DRIFT]
                drift_squared += cloud[at + DRIFT] * cloud[at + DRIFT]
                scale += cloud[at + LOG_SCALE]
                scale_squared += cloud[at + LOG_SCALE] * cloud[at + LOG_SCALE]
            sums[lane] += drift
            sums[_DRIFT_SQUARED + lane] += drift_squared
            sums[_SCALE + lane] += scale
            sums[_SCALE_SQUARED + lane] += scale_squared
    totals = np.empty(4)
    across(sums, totals)
    drift_mean, drift_sd = _mean_and_sd(totals[0] / count, totals[1] / count)
    scale_mean, scale_sd = _mean_and_sd(totals[2] / count, totals[3] / count)
    drift_mean, drift_scatter = (ONE - kept) * drift_mean, scatter * drift_sd
    scale_mean, scale_scatter = (ONE - kept) * scale_mean, scatter * scale_sd
    for block in range(count // LANES):
        o = block * BLOCK
        drifts, scales = two_places(random_bits(u32(block), key_low, key_high))
        for lane in range(LANES):
            to_drift = drift_mean + drift_scatter * NORMAL[drifts + lane]
            to_scale = scale_mean + scale_scatter * NORMAL[scales + lane]
            drift = kept * cloud[o + DRIFT + lane] + to_drift
            log_scale = kept * cloud[o + LOG_SCALE + lane] + to_scale
            cloud[o + DRIFT + lane], cloud[o + LOG_SCALE + lane] = drift, log_scale
            cloud[o + SCALE + lane] = exponential(log_scale)
            cloud[o + WEIGHT + lane] = weight


@compiled
def _mean_and_sd(mean: float, square: float) -> tuple[np.float32, np.float32]:
    """Return mean and standard deviation of what has this mean, and whose squares have that."""
    return f32(mean), f32(math.sqrt(max(square - mean * mean, 0.0)))
