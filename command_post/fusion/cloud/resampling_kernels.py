"""The compiled filter's resampling: particles drawn anew by weight. Meaning: cloud_plain.py."""

from __future__ import annotations

import math

import numpy as np

from command_post.fusion.cloud.lane_arithmetic import (
    ONE,
    across,
    exponential,
    f32,
    i32,
    random_bits,
    sine_cosine,
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
    WEIGHT,
    Indices,
    Lanes,
)
from command_post.fusion.cloud.noise import NORMAL, two_places
from shared.compiled import compiled

_RESAMPLING = u32(0x9E3779B9)
_BITS_30 = f32(2.0**30)


@compiled
def resample(
    cloud: Lanes,
    drawn: Lanes,
    kept: np.float32,
    key_low: np.uint32,
    key_high: np.uint32,
) -> None:
    """Fill ``drawn`` with particles drawn systematically by weight; all weigh alike."""
    key_low = u32(key_low ^ _RESAMPLING)
    count = cloud.size // BLOCK * LANES
    source = np.empty(count + 2, np.int32)
    _draw(cloud, drawn, source, random_bits(u32(0xFFFFFFFF), key_low, key_high))
    for block in range(count // LANES):
        o = block * BLOCK
        for lane in range(LANES):
            taken = source[block * LANES + lane]
            drawn[o + NORTH + lane] = cloud[taken + NORTH]
            drawn[o + EAST + lane] = cloud[taken + EAST]
            drawn[o + OFFSET + lane] = cloud[taken + OFFSET]
            drawn[o + DRIFT + lane] = cloud[taken + DRIFT]
            drawn[o + LOG_SCALE + lane] = cloud[taken + LOG_SCALE]
    _loosen(drawn, kept, key_low, key_high)


@compiled
def _draw(cloud: Lanes, shares: Lanes, source: Indices, bits: np.uint32) -> None:
    """Write where the particle lies that each new one copies, so that copies go by weight.

    Weights become whole numbers, in ``shares``' weights, that no rounding may add up. Along
    their running sum stand as many marks as particles, evenly, the first by chance. A particle is
    written to its marks, and to one or two more, which are the next one's to write over.
    """
    count = source.size - 2
    total = 0
    for block in range(count // LANES):
        o = block * BLOCK + WEIGHT
        for lane in range(LANES):
            share = i32(cloud[o + lane] * _BITS_30)
            shares[o + lane] = f32(share)
            total += int(share)
    spacing = total // count
    before_first = spacing - ((int(bits) * spacing) >> 32)
    marks_per_unit = 1.0 / spacing
    reached = mark = 0
    for block in range(count // LANES):
        o = block * BLOCK
        for lane in range(LANES):
            source[mark] = source[mark + 1] = o + lane
            reached += int(shares[o + WEIGHT + lane])
            following = min(int((reached + before_first) * marks_per_unit), count)
            for further in range(mark + 2, following):
                source[further] = o + lane
            mark = following


@compiled
def _loosen(cloud: Lanes, kept: np.float32, key_low: np.uint32, key_high: np.uint32) -> None:
    """Weigh all alike, and let copies differ in drift and scale, which no stride loosens much.

    Each is drawn to the mean by ``kept`` and scattered by what that takes from the spread, so that
    mean and variance stay (Liu and West 2001, section 10.3).
    """
    count = cloud.size // BLOCK * LANES
    weight = ONE / f32(count)
    scatter = f32(math.sqrt(ONE - kept * kept))
    drift_mean, drift_sd = _mean_and_sd(cloud, DRIFT)
    scale_mean, scale_sd = _mean_and_sd(cloud, LOG_SCALE)
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
        for lane in range(LANES):
            sine, cosine = sine_cosine(cloud[o + OFFSET + lane])
            cloud[o + SINE + lane], cloud[o + COSINE + lane] = sine, cosine


@compiled
def _mean_and_sd(cloud: Lanes, field: int) -> tuple[np.float32, np.float32]:
    """Return mean and standard deviation of a field, all particles weighing alike."""
    sums = np.zeros(2 * LANES, np.float32)
    blocks = cloud.size // BLOCK
    for block in range(blocks):
        o = block * BLOCK + field
        for lane in range(LANES):
            value = cloud[o + lane]
            sums[lane] += value
            sums[LANES + lane] += value * value
    mean = across(sums, 0) / (blocks * LANES)
    variance = across(sums, LANES) / (blocks * LANES) - mean * mean
    return f32(mean), f32(math.sqrt(max(variance, 0.0)))
