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
    SUM_LANES,
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
_MOST = f32(3e38)
_CUBED, _LEAST_CUBED = f32(-3.0), f32(math.exp(-40.0 / 3.0))

_SUMS = 9
_SQUARES, _N, _E, _NN, _NE, _EE, _COSINE, _SINE = (SUM_LANES * row for row in range(1, _SUMS))
_LOWS, _NORTH, _EAST, _PRODUCTS = 8, LANES, 2 * LANES, 3 * LANES


@compiled
def run_steps(
    cloud: Lanes, steps: Lanes, keys: Keys, ties: Lanes, tie_ends: Counts, summaries: Lanes
) -> Lanes:
    """Return the cloud after ``steps`` (n, STEP_WIDTH) under ``keys`` (n, 2).

    ``ties`` up to row ``tie_ends[i]`` belong to step i; ``summaries`` (n, SUMMARY_WIDTH) are
    written. ``cloud`` itself is not.
    """
    here = cloud.copy()
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
            resample(here, step[KEPT_SPREAD], keys[i, 0], keys[i, 1])
            summaries[i, RESAMPLED] = ONE
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
    first = last = ties.shape[0]
    while last > 0:
        exponent = ties[last - 1, TIE_EXPONENT]
        first = last - 1
        while first > max(last - MOST_AT_ONCE, 0) and ties[first - 1, TIE_EXPONENT] == exponent:
            first -= 1
        work[:_LOWS] = _MOST
        _multiply(cloud, ties, first, last, work)
        lowest = _lowest(work)
        _weigh(cloud, work, lowest, exponent)
        common += exponent * natural_log(lowest)
        last = first
    for i in range(ties.shape[0]):
        common -= natural_log(ties[i, TIE_AREA])
    return common


@compiled
def _multiply(cloud: Lanes, ties: Lanes, first: int, last: int, work: Lanes) -> None:
    """Write each particle's product of one and its squared distances from ties' places."""
    for block in range(cloud.size // BLOCK):
        o, p = block * BLOCK, block * LANES + _PRODUCTS
        for lane in range(LANES):
            work[p + lane] = ONE
        for i in range(first, last):
            since_north, since_east = ties[i, SINCE_NORTH], ties[i, SINCE_EAST]
            if i == first or _led_apart(ties, i):
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
        for lane in range(_LOWS):
            low = work[lane]
            for at in range(p + lane, p + lane + LANES, _LOWS):
                low = min(low, work[at])
            work[lane] = low


@compiled
def _led_apart(ties: Lanes, i: int) -> bool:
    """Whether not the same displacement led on from this tie's moment as from the one's before."""
    same_north = ties[i, SINCE_NORTH] == ties[i - 1, SINCE_NORTH]
    return not (same_north and ties[i, SINCE_EAST] == ties[i - 1, SINCE_EAST])


@compiled
def _lowest(work: Lanes) -> np.float32:
    """Return the lowest product of those that ``_multiply`` found the lowest of their lanes."""
    lowest = _MOST
    for lane in range(_LOWS):
        lowest = min(lowest, work[lane])
    return lowest


@compiled
def _weigh(cloud: Lanes, work: Lanes, lowest: np.float32, exponent: np.float32) -> None:
    """Multiply the weights by the products' powers, of which the highest is one."""
    for block in range(cloud.size // BLOCK):
        o, p = block * BLOCK + WEIGHT, block * LANES + _PRODUCTS
        if exponent == _CUBED:
            for lane in range(LANES):
                ratio = max(lowest / work[p + lane], _LEAST_CUBED)
                weight = cloud[o + lane] * (ratio * ratio * ratio)
                cloud[o + lane] = max(weight, LEAST_WEIGHT)
        else:
            for lane in range(LANES):
                ratio = exponential(exponent * natural_log(work[p + lane] / lowest))
                cloud[o + lane] = max(cloud[o + lane] * ratio, LEAST_WEIGHT)


@compiled
def _summarise(cloud: Lanes, summary: Lanes) -> None:
    """Scale the weights to sum to one, and write the cloud's moments."""
    sums = np.zeros(_SUMS * SUM_LANES, np.float32)
    north, east = cloud[NORTH], cloud[EAST]
    _add_up(cloud, sums, north, east)
    totals = np.empty(_SUMS)
    across(sums, totals)
    whole = totals[0]
    share = f32(1.0 / whole)
    for block in range(cloud.size // BLOCK):
        o = block * BLOCK + WEIGHT
        for lane in range(LANES):
            cloud[o + lane] *= share
    _write_moments(totals, summary, north, east)
    summary[LOG_EVIDENCE] += natural_log(f32(whole))


@compiled
def _add_up(cloud: Lanes, sums: Lanes, north: np.float32, east: np.float32) -> None:
    """Add weights, and weighted moments about (north, east), into ``sums``, lane by lane."""
    for block in range(cloud.size // BLOCK):
        o = block * BLOCK
        for lane in range(SUM_LANES):
            whole = squares = n = e = nn = ne = ee = cosine = sine = ZERO
            for at in range(o + lane, o + lane + LANES, SUM_LANES):
                w = cloud[at + WEIGHT]
                u, v = cloud[at + NORTH] - north, cloud[at + EAST] - east
                wu, wv = w * u, w * v
                whole, squares, n, e = whole + w, squares + w * w, n + wu, e + wv
                nn, ne, ee = nn + wu * u, ne + wu * v, ee + wv * v
                cosine, sine = cosine + w * cloud[at + COSINE], sine + w * cloud[at + SINE]
            sums[lane] += whole
            sums[_SQUARES + lane] += squares
            sums[_N + lane] += n
            sums[_E + lane] += e
            sums[_NN + lane] += nn
            sums[_NE + lane] += ne
            sums[_EE + lane] += ee
            sums[_COSINE + lane] += cosine
            sums[_SINE + lane] += sine


@compiled
def _write_moments(totals: Sums, summary: Lanes, north: np.float32, east: np.float32) -> None:
    """Write the moments from the ``totals`` of what ``_add_up`` added about (north, east)."""
    whole = totals[0]
    n, e = totals[2] / whole, totals[3] / whole
    summary[MEAN_NORTH], summary[MEAN_EAST] = north + n, east + e
    summary[VAR_NN] = max(totals[4] / whole - n * n, 0.0)
    summary[VAR_NE] = totals[5] / whole - n * e
    summary[VAR_EE] = max(totals[6] / whole - e * e, 0.0)
    cosine, sine = totals[7] / whole, totals[8] / whole
    length = math.sqrt(cosine * cosine + sine * sine)
    summary[MEAN_OFFSET] = bearing(sine, cosine)
    summary[OFFSET_SD] = math.sqrt(-2.0 * natural_log(f32(min(max(length, 1e-9), 1.0))))
    summary[EFFECTIVE] = whole * whole / totals[1]
