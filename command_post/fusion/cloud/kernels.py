"""The compiled filter: what moves, weighs and sums up a cloud. Meaning: cloud_plain.py.

Every loop over lanes is free of branches and touches one buffer, or one more for what is handed
from loop to loop: a processor works on as many lanes at once as it can look ahead, more of them the
less there is to do for each. No loop takes a view of an array, for each view is counted, and the
count waits for memory. Sums run lane by lane and only then across the lanes, always in the same
order, so that they come out alike whatever the width of the processor's vectors. ``run_steps`` is
the one way in: a single step and a night's replay go through the same code.
"""

from __future__ import annotations

import math

import numpy as np

from command_post.fusion.cloud.lane_arithmetic import (
    LEAST_EXPONENT,
    LEAST_WEIGHT,
    ONE,
    PI,
    TURN,
    TWO,
    ZERO,
    across,
    bearing,
    exponential,
    f32,
    gaussian,
    natural_log,
    random_bits,
    sine_cosine,
    u32,
)
from command_post.fusion.cloud.layout import (
    BLOCK,
    COMPONENT_MEAN,
    COMPONENT_ROOT,
    COMPONENT_TURNED,
    COSINE,
    DRIFT,
    DRIFT_WALK,
    EAST,
    EFFECTIVE,
    JUMP_BELOW,
    KEPT_SPREAD,
    LANES,
    LOG_EVIDENCE,
    LOG_SCALE,
    MEAN_EAST,
    MEAN_NORTH,
    MEAN_OFFSET,
    MISSED_FROM,
    MOST_AT_ONCE,
    MOVE_EAST,
    MOVE_NORTH,
    MOVE_S,
    NORTH,
    OFFSET,
    OFFSET_SD,
    RESAMPLE_BELOW,
    RESAMPLED,
    ROOT_EE,
    ROOT_EN,
    ROOT_HE,
    ROOT_HH,
    ROOT_HN,
    ROOT_JUMP,
    ROOT_NN,
    SCALE,
    SINCE_EAST,
    SINCE_NORTH,
    SINE,
    TIE_AREA,
    TIE_EAST,
    TIE_EE,
    TIE_EXPONENT,
    TIE_NE,
    TIE_NN,
    TIE_NORTH,
    VAR_EE,
    VAR_NE,
    VAR_NN,
    WEIGHT,
    Counts,
    Keys,
    Lanes,
    Sums,
)
from command_post.fusion.cloud.noise import CHANCE, NORMAL, two_places
from command_post.fusion.cloud.resampling_kernels import resample
from shared.compiled import compiled

_BITS_24, _TURN_24 = f32(2.0**-24), f32(2.0**-23 * math.pi)
_TURNS = f32(0.5 / math.pi)
_TO_WHOLE = f32(1.5 * 2**23)
"""Added to a number and taken away again it leaves the next whole one, having no bits for more."""
_MOST, _MOST_TIMES = f32(3e38), 8

_SUMS = 9
_SQUARES, _U, _V, _UU, _UV, _VV, _COSINE, _SINE = (LANES * row for row in range(1, _SUMS))
_NORTH, _EAST, _LOWEST, _PRODUCTS = (LANES * row for row in range(4))


@compiled
def run_steps(
    cloud: Lanes, steps: Lanes, keys: Keys, ties: Lanes, tie_ends: Counts, summaries: Lanes
) -> Lanes:
    """Return the cloud after ``steps`` (n, STEP_WIDTH) under ``keys`` (n, 2).

    ``ties`` up to row ``tie_ends[i]`` belong to step i; ``summaries`` (n, SUMMARY_WIDTH) are
    written. ``cloud`` itself is not.
    """
    here, spare = cloud.copy(), np.empty_like(cloud)
    work = np.empty(cloud.size // BLOCK * LANES + _PRODUCTS, np.float32)
    tie = 0
    for i in range(steps.shape[0]):
        step = steps[i]
        summaries[i] = ZERO
        if step[MOVE_S] >= ZERO:
            _move(here, step, keys[i, 0], keys[i, 1])
        if tie < tie_ends[i]:
            summaries[i, LOG_EVIDENCE] = _tie(here, ties[tie : tie_ends[i]], work)
            tie = tie_ends[i]
        _summarise(here, summaries[i])
        if summaries[i, EFFECTIVE] < step[RESAMPLE_BELOW]:
            resample(here, spare, step[KEPT_SPREAD], keys[i, 0], keys[i, 1])
            summaries[i, RESAMPLED] = ONE
            here, spare = spare, here
    return here


@compiled
def spawn_particles(
    count: int, components: Lanes, key_low: np.uint32, key_high: np.uint32
) -> Lanes:
    """Return a cloud of a mixture ``components`` (k, COMPONENT_WIDTH); all weigh alike.

    Each component gets its share of the particles, give or take one.
    """
    cloud = np.empty(count // LANES * BLOCK, np.float32)
    weight = ONE / f32(count)
    first = f32(random_bits(u32(0xFFFFFFFF), key_low, key_high) >> u32(8)) * _BITS_24
    component = 0
    normal = np.empty(5, np.float32)
    place = np.empty(5, np.float32)
    for i in range(count):
        mark = (f32(i) + first) / f32(count)
        while component < components.shape[0] - 1 and mark >= components[component, 0]:
            component += 1
        row = components[component]
        root = COMPONENT_ROOT
        for j in range(5):
            normal[j] = gaussian(random_bits(u32(8 * i + j), key_low, key_high))
            place[j] = row[COMPONENT_MEAN + j]
            for k in range(j + 1):
                place[j] += row[root] * normal[k]
                root += 1
        if row[COMPONENT_TURNED] > ZERO:
            place[2] = f32(random_bits(u32(8 * i + 5), key_low, key_high) >> u32(8)) * _TURN_24 - PI
        o = i // LANES * BLOCK + i % LANES
        cloud[o + NORTH], cloud[o + EAST] = place[0], place[1]
        cloud[o + OFFSET] = _wrapped(place[2])
        cloud[o + LOG_SCALE], cloud[o + DRIFT] = place[3], place[4]
        cloud[o + WEIGHT] = weight
        cloud[o + SCALE] = exponential(place[3])
        cloud[o + SINE], cloud[o + COSINE] = sine_cosine(cloud[o + OFFSET])
    return cloud


@compiled
def weighted_places(cloud: Lanes) -> Lanes:
    """Return (3, n): metres north and east of the cloud's origin, and the weight."""
    count = cloud.size // BLOCK * LANES
    places = np.empty((3, count), np.float32)
    for i in range(count):
        o = i // LANES * BLOCK + i % LANES
        places[0, i], places[1, i] = cloud[o + NORTH], cloud[o + EAST]
        places[2, i] = cloud[o + WEIGHT]
    return places


@compiled
def _move(cloud: Lanes, step: Lanes, key_low: np.uint32, key_high: np.uint32) -> None:
    """Displace every particle, turned and scaled, each with its own noise; drift its heading."""
    d_north, d_east, elapsed_s = step[MOVE_NORTH], step[MOVE_EAST], step[MOVE_S]
    twice_north, twice_east = TWO * d_north, TWO * d_east
    nn, en, ee = step[ROOT_NN], step[ROOT_EN], step[ROOT_EE]
    hn, he, hh, jump = step[ROOT_HN], step[ROOT_HE], step[ROOT_HH], step[ROOT_JUMP]
    jump_below, missed_from, walk = step[JUMP_BELOW], step[MISSED_FROM], step[DRIFT_WALK]
    for block in range(cloud.size // BLOCK):
        o = block * BLOCK
        counter = u32(3 * block)
        norths, easts = two_places(random_bits(counter, key_low, key_high))
        headings, drifts = two_places(random_bits(u32(counter + u32(1)), key_low, key_high))
        chances, _ = two_places(random_bits(u32(counter + u32(2)), key_low, key_high))
        for lane in range(LANES):
            to_north, to_east = NORMAL[norths + lane], NORMAL[easts + lane]
            happening = CHANCE[chances + lane]
            own = jump if happening < jump_below else hh
            missed = happening >= missed_from
            north = (twice_north if missed else d_north) + nn * to_north
            east = (twice_east if missed else d_east) + en * to_north + ee * to_east
            scale = cloud[o + SCALE + lane]
            cosine, sine = scale * cloud[o + COSINE + lane], scale * cloud[o + SINE + lane]
            cloud[o + NORTH + lane] += cosine * north - sine * east
            cloud[o + EAST + lane] += sine * north + cosine * east
            drift = cloud[o + DRIFT + lane] + walk * NORMAL[drifts + lane]
            cloud[o + DRIFT + lane] = drift
            turned = hn * to_north + he * to_east + own * NORMAL[headings + lane]
            offset = cloud[o + OFFSET + lane] + drift * elapsed_s + turned
            cloud[o + OFFSET + lane] = _wrapped(offset)
        for lane in range(LANES):
            sine, cosine = sine_cosine(cloud[o + OFFSET + lane])
            cloud[o + SINE + lane], cloud[o + COSINE + lane] = sine, cosine


@compiled
def _wrapped(angle_rad: np.float32) -> np.float32:
    """Return an angle of less than a million turns brought to within ±π."""
    turns = (angle_rad * _TURNS + _TO_WHOLE) - _TO_WHOLE
    return angle_rad - turns * TURN


@compiled
def _tie(cloud: Lanes, ties: Lanes, work: Lanes) -> np.float32:
    """Weigh in that the responder was at places, some strides ago; ``ties`` (n, TIE_WIDTH).

    Neighbours of one exponent are weighed at once. Returned is the logarithm of what the
    likelihoods have in common.
    """
    common = ZERO
    first, last = 0, ties.shape[0]
    while first < last:
        exponent = ties[first, TIE_EXPONENT]
        end = first + 1
        while end < min(first + MOST_AT_ONCE, last) and ties[end, TIE_EXPONENT] == exponent:
            end += 1
        lowest = _multiply(cloud, ties, first, end, work)
        _weigh(cloud, work, lowest, exponent)
        common += exponent * natural_log(lowest)
        first = end
    for i in range(last):
        common -= natural_log(ties[i, TIE_AREA])
    return common


@compiled
def _multiply(cloud: Lanes, ties: Lanes, first: int, end: int, work: Lanes) -> np.float32:
    """Write each particle's product of one and its squared distances; return the lowest."""
    for lane in range(LANES):
        work[_LOWEST + lane] = _MOST
    for block in range(cloud.size // BLOCK):
        o, p = block * BLOCK, block * LANES + _PRODUCTS
        for lane in range(LANES):
            work[p + lane] = ONE
        for i in range(first, end):
            since_north, since_east = ties[i, SINCE_NORTH], ties[i, SINCE_EAST]
            same = i > first and since_north == ties[i - 1, SINCE_NORTH]
            if not (same and since_east == ties[i - 1, SINCE_EAST]):
                for lane in range(LANES):
                    scale = cloud[o + SCALE + lane]
                    cosine, sine = scale * cloud[o + COSINE + lane], scale * cloud[o + SINE + lane]
                    north, east = cloud[o + NORTH + lane], cloud[o + EAST + lane]
                    work[_NORTH + lane] = north - (cosine * since_north - sine * since_east)
                    work[_EAST + lane] = east - (sine * since_north + cosine * since_east)
            north, east = ties[i, TIE_NORTH], ties[i, TIE_EAST]
            nn, ne, ee = ties[i, TIE_NN], ties[i, TIE_NE], ties[i, TIE_EE]
            for lane in range(LANES):
                u, v = work[_NORTH + lane] - north, work[_EAST + lane] - east
                work[p + lane] *= ONE + u * (nn * u + ne * v) + ee * v * v
        for lane in range(LANES):
            # Without the sum a compiler would write only where it is lower, a lane at a time.
            work[_LOWEST + lane] = min(work[_LOWEST + lane], work[p + lane]) + ZERO
    lowest = _MOST
    for lane in range(LANES):
        lowest = min(lowest, work[_LOWEST + lane])
    return lowest


@compiled
def _weigh(cloud: Lanes, work: Lanes, lowest: np.float32, exponent: np.float32) -> None:
    """Multiply the weights by the products' powers, of which the highest is one."""
    times = int(-exponent)
    if f32(times) != -exponent or times > _MOST_TIMES:
        for block in range(cloud.size // BLOCK):
            o, p = block * BLOCK + WEIGHT, block * LANES + _PRODUCTS
            for lane in range(LANES):
                ratio = exponential(exponent * natural_log(work[p + lane] / lowest))
                cloud[o + lane] = max(cloud[o + lane] * ratio, LEAST_WEIGHT)
        return
    least = exponential(LEAST_EXPONENT / f32(times))
    for block in range(cloud.size // BLOCK):
        o, p = block * BLOCK + WEIGHT, block * LANES + _PRODUCTS
        for lane in range(LANES):
            work[p + lane] = max(lowest / work[p + lane], least)
        for _ in range(times):
            for lane in range(LANES):
                cloud[o + lane] *= work[p + lane]
        for lane in range(LANES):
            cloud[o + lane] = max(cloud[o + lane], LEAST_WEIGHT)


@compiled
def _summarise(cloud: Lanes, summary: Lanes) -> None:
    """Scale the weights to sum to one, and write the cloud's moments."""
    sums = np.zeros(_SUMS * LANES, np.float32)
    north, east = cloud[NORTH], cloud[EAST]
    _add_up(cloud, sums, north, east)
    totals = np.zeros(_SUMS)
    for row in range(_SUMS):
        totals[row] = across(sums, row * LANES)
    share = f32(1.0 / totals[0])
    for block in range(cloud.size // BLOCK):
        o = block * BLOCK + WEIGHT
        for lane in range(LANES):
            cloud[o + lane] *= share
    _write_moments(totals, summary, north, east)
    summary[LOG_EVIDENCE] += natural_log(f32(totals[0]))


@compiled
def _add_up(cloud: Lanes, sums: Lanes, north: np.float32, east: np.float32) -> None:
    """Add each lane's weights, and weighted moments about (north, east), into ``sums``."""
    for block in range(cloud.size // BLOCK):
        o = block * BLOCK
        for lane in range(LANES):
            w = cloud[o + WEIGHT + lane]
            u, v = cloud[o + NORTH + lane] - north, cloud[o + EAST + lane] - east
            wu, wv = w * u, w * v
            sums[lane] += w
            sums[_SQUARES + lane] += w * w
            sums[_U + lane] += wu
            sums[_V + lane] += wv
            sums[_UU + lane] += wu * u
            sums[_UV + lane] += wu * v
            sums[_VV + lane] += wv * v
            sums[_COSINE + lane] += w * cloud[o + COSINE + lane]
            sums[_SINE + lane] += w * cloud[o + SINE + lane]


@compiled
def _write_moments(totals: Sums, summary: Lanes, north: np.float32, east: np.float32) -> None:
    """Write the moments from the ``totals`` of what ``_add_up`` added about (north, east)."""
    whole = totals[0]
    means = totals / whole
    u, v = means[2], means[3]
    summary[MEAN_NORTH], summary[MEAN_EAST] = north + u, east + v
    summary[VAR_NN] = max(means[4] - u * u, 0.0)
    summary[VAR_NE] = means[5] - u * v
    summary[VAR_EE] = max(means[6] - v * v, 0.0)
    length = math.sqrt(means[7] * means[7] + means[8] * means[8])
    summary[MEAN_OFFSET] = bearing(means[8], means[7])
    summary[OFFSET_SD] = math.sqrt(-2.0 * natural_log(f32(min(max(length, 1e-9), 1.0))))
    summary[EFFECTIVE] = whole * whole / totals[1]
