"""The compiled filter: what moves, weighs and sums up a cloud. Meaning: cloud_plain.py.

Every loop over lanes is free of branches and touches one buffer, or one more for what is handed
from loop to loop: a processor works on as many lanes at once as it can look ahead, more of them the
less there is to do for each. Sums run lane by lane and only then across the lanes, always in the
same order, so that they come out alike whatever the width of the processor's vectors. ``run_steps``
is the one way in: a single step and a night's replay go through the same code.
"""

from __future__ import annotations

import math

import numpy as np

from command_post.fusion.cloud.lane_arithmetic import (
    ONE,
    PI,
    TURN,
    TWO,
    ZERO,
    across,
    bearing,
    even,
    exponential,
    f32,
    gaussian,
    log_of,
    log_parts,
    lower_half,
    natural_log,
    power_of,
    power_parts,
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
    LOG_WEIGHT,
    MEAN_EAST,
    MEAN_NORTH,
    MEAN_OFFSET,
    MISSED_FROM,
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
    Counts,
    Keys,
    Lanes,
    Sums,
)
from command_post.fusion.cloud.resampling_kernels import face, resample
from shared.compiled import compiled

_BITS_24, _TURN_24 = f32(2.0**-24), f32(2.0**-23 * math.pi)
_NOTHING_YET = f32(-3e38)

_MOST_AT_ONCE = 5

_SUMS = 9
_SQUARES, _U, _V, _UU, _UV, _VV, _COSINE, _SINE = (LANES * row for row in range(1, _SUMS))
_COS, _SIN, _E, _LAST = (LANES * row for row in range(1, 5))


@compiled
def run_steps(
    cloud: Lanes, steps: Lanes, keys: Keys, ties: Lanes, tie_ends: Counts, summaries: Lanes
) -> Lanes:
    """Return the cloud after ``steps`` (n, STEP_WIDTH) under ``keys`` (n, 2).

    ``ties`` up to row ``tie_ends[i]`` belong to step i; ``summaries`` (n, SUMMARY_WIDTH) are
    written. ``cloud`` itself is not.
    """
    here, spare = cloud.copy(), np.empty_like(cloud)
    tie = 0
    for i in range(steps.shape[0]):
        step = steps[i]
        summaries[i] = ZERO
        if step[MOVE_S] >= ZERO:
            _move(here, step, keys[i, 0], keys[i, 1])
        if tie < tie_ends[i]:
            summaries[i, LOG_EVIDENCE] = _tie(here, ties[tie : tie_ends[i]])
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
    log_weight = -natural_log(f32(count))
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
        cloud[o + NORTH], cloud[o + EAST], cloud[o + OFFSET] = place[0], place[1], place[2]
        while abs(cloud[o + OFFSET]) > PI:
            cloud[o + OFFSET] = _wrapped(cloud[o + OFFSET])
        cloud[o + LOG_SCALE], cloud[o + DRIFT] = place[3], place[4]
        cloud[o + LOG_WEIGHT] = log_weight
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
        places[2, i] = exponential(cloud[o + LOG_WEIGHT])
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
        counter = u32(block * LANES * 4)
        for lane in range(LANES):
            first = random_bits(counter, key_low, key_high)
            second = random_bits(u32(counter + u32(1)), key_low, key_high)
            third = random_bits(u32(counter + u32(2)), key_low, key_high)
            fourth = random_bits(u32(counter + u32(3)), key_low, key_high)
            counter = u32(counter + u32(4))
            to_north, to_east, to_heading = gaussian(first), gaussian(second), gaussian(third)
            happening = lower_half(fourth)
            own = jump if happening < jump_below else hh
            missed = happening >= missed_from
            north = (twice_north if missed else d_north) + nn * to_north
            east = (twice_east if missed else d_east) + en * to_north + ee * to_east
            scale = cloud[o + SCALE + lane]
            cosine, sine = scale * cloud[o + COSINE + lane], scale * cloud[o + SINE + lane]
            cloud[o + NORTH + lane] += cosine * north - sine * east
            cloud[o + EAST + lane] += sine * north + cosine * east
            drift = cloud[o + DRIFT + lane] + walk * even(fourth)
            cloud[o + DRIFT + lane] = drift
            turned = hn * to_north + he * to_east + own * to_heading
            offset = cloud[o + OFFSET + lane] + drift * elapsed_s + turned
            cloud[o + OFFSET + lane] = _wrapped(offset)
        face(cloud[o : o + BLOCK])


@compiled
def _wrapped(angle_rad: np.float32) -> np.float32:
    """Return an angle within ±2π brought to within ±π."""
    if angle_rad > PI:
        angle_rad -= TURN
    if angle_rad < -PI:
        angle_rad += TURN
    return angle_rad


@compiled
def _tie(cloud: Lanes, ties: Lanes) -> np.float32:
    """Weigh in that the responder was at places, some strides ago; ``ties`` (n, TIE_WIDTH).

    The logarithm is taken once for neighbours of one exponent, as many as cannot overflow for
    anyone within ten thousand standard deviations of each. Returned is the logarithm of what the
    likelihoods have in common.
    """
    work = np.empty(5 * LANES, np.float32)
    last = ties.shape[0] - 1
    for block in range(cloud.size // BLOCK):
        o = block * BLOCK
        for lane in range(LANES):
            scale = cloud[o + SCALE + lane]
            work[lane] = ONE
            work[_COS + lane] = scale * cloud[o + COSINE + lane]
            work[_SIN + lane] = scale * cloud[o + SINE + lane]
        since_log = 0
        for i in range(last + 1):
            tie = ties[i]
            north, east, exponent = tie[TIE_NORTH], tie[TIE_EAST], tie[TIE_EXPONENT]
            since_north, since_east = tie[SINCE_NORTH], tie[SINCE_EAST]
            nn, ne, ee = tie[TIE_NN], tie[TIE_NE], tie[TIE_EE]
            for lane in range(LANES):
                cosine, sine = work[_COS + lane], work[_SIN + lane]
                u = cloud[o + NORTH + lane] - (cosine * since_north - sine * since_east) - north
                v = cloud[o + EAST + lane] - (sine * since_north + cosine * since_east) - east
                work[lane] *= ONE + u * (nn * u + ne * v) + ee * v * v
            since_log += 1
            if i == last or since_log == _MOST_AT_ONCE or exponent != ties[i + 1, TIE_EXPONENT]:
                since_log = 0
                for lane in range(LANES):
                    x, e, series = log_parts(work[lane])
                    work[lane], work[_E + lane], work[_LAST + lane] = x, e, series
                for lane in range(LANES):
                    log = log_of(work[lane], work[_E + lane], work[_LAST + lane])
                    cloud[o + LOG_WEIGHT + lane] += exponent * log
                    work[lane] = ONE
    common = ZERO
    for i in range(last + 1):
        common -= natural_log(ties[i, TIE_AREA])
    return common


@compiled
def _summarise(cloud: Lanes, summary: Lanes) -> None:
    """Scale the weights to sum to one, and write the cloud's moments."""
    sums = np.zeros(_SUMS * LANES, np.float32)
    peak = _highest_log_weight(cloud, sums)
    north, east = cloud[NORTH], cloud[EAST]
    _add_up(cloud, sums, peak, north, east)
    totals = np.zeros(_SUMS)
    for row in range(_SUMS):
        totals[row] = across(sums[row * LANES : (row + 1) * LANES])
    log_total = peak + natural_log(f32(totals[0]))
    for block in range(cloud.size // BLOCK):
        o = block * BLOCK + LOG_WEIGHT
        for lane in range(LANES):
            cloud[o + lane] -= log_total
    _write_moments(totals, summary, north, east)
    summary[LOG_EVIDENCE] += log_total


@compiled
def _highest_log_weight(cloud: Lanes, highest: Lanes) -> np.float32:
    """Return the highest log-weight; the first 64 of ``highest`` are used and left at nought."""
    highest[:LANES] = _NOTHING_YET
    for block in range(cloud.size // BLOCK):
        o = block * BLOCK + LOG_WEIGHT
        for lane in range(LANES):
            # Without the sum a compiler would write only where it is higher, a lane at a time.
            highest[lane] = max(highest[lane], cloud[o + lane]) + ZERO
    for lane in range(32):
        highest[lane] = max(highest[lane], highest[lane + 32])
    peak = _NOTHING_YET
    for lane in range(32):
        peak = max(peak, highest[lane])
    highest[:LANES] = ZERO
    return peak


@compiled
def _add_up(
    cloud: Lanes, sums: Lanes, peak: np.float32, north: np.float32, east: np.float32
) -> None:
    """Add each lane's weights, and weighted moments about (north, east), into ``sums``."""
    work = np.empty(2 * LANES, np.float32)
    for block in range(cloud.size // BLOCK):
        o = block * BLOCK
        for lane in range(LANES):
            r, scale = power_parts(cloud[o + LOG_WEIGHT + lane] - peak)
            work[lane], work[LANES + lane] = r, scale
        for lane in range(LANES):
            work[lane] = power_of(work[lane], work[LANES + lane])
        for lane in range(LANES):
            w = work[lane]
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
