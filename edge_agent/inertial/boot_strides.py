"""The boot's strides, one sample at a time: detect, filter, cut, smooth, publish.

The filter walks a fixed look-ahead behind the newest sample, because stillness is judged with what
comes after it. :func:`step` is the only way in; :func:`run` is the same step over an array.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from edge_agent.inertial.boot_filter import filter_slot
from edge_agent.inertial.boot_state import (
    STANDING,
    STRIDE,
    UNFINISHED,
    Outcome,
    OutcomeRecord,
    State,
    StateRecord,
)
from edge_agent.inertial.eskf_parameters import (
    CAPACITY,
    Parameters,
    ParametersRecord,
)
from edge_agent.inertial.foot_mechanisation import rotation_matrix, turn_about_down, turn_nav
from edge_agent.inertial.gap_bridging import bridge_gap, draw_line
from edge_agent.inertial.sample_ring import BRIDGED, DOUBT, RATE_DOUBT, STEP
from edge_agent.inertial.saturation import watch_flat_tops
from edge_agent.inertial.stride_smoothing import FILTERED, smooth_stride
from edge_agent.inertial.zero_velocity import shoe_statistic
from edge_agent.inertial.zupt_filter import HEADING, START_HEADING, STATES
from shared.compiled import compiled

MOST_HELD = 16
"""More strides than can be ahead of the filter at once."""


@compiled
def write_lean(s: StateRecord, o: OutcomeRecord, first: int, last: int) -> None:
    """Write how what pointed up at the anchor leans on average over slots ``first … last``."""
    anchor, now = np.empty((3, 3)), np.empty((3, 3))
    rotation_matrix(s.anchor_quat_wxyz, anchor)
    o.lean[:] = 0.0
    for slot in range(first, last + 1):
        rotation_matrix(s.history[slot & (CAPACITY - 1), FILTERED + 3 : FILTERED + 7], now)
        for c in range(2):
            for i in range(3):
                o.lean[c] -= now[c, i] * anchor[2, i] / (last + 1 - first)


@compiled
def placement_variance(
    start: NDArray[np.float64], end: NDArray[np.float64], turned_rad: float, p: ParametersRecord
) -> float:
    """How well a foot's place stands for it, from one stance to the next: m², along each axis.

    A foot is set down on a place that is not a point: the less alike its two attitudes (``start``
    and ``end``, quat_wxyz) lean, the less alike it is set down. And as it turns, each point of it
    goes another way.
    """
    first, last = np.empty((3, 3)), np.empty((3, 3))
    rotation_matrix(start, first)
    rotation_matrix(end, last)
    alike = first[2, 0] * last[2, 0] + first[2, 1] * last[2, 1] + first[2, 2] * last[2, 2]
    tilted_rad = min(math.acos(max(-1.0, min(1.0, alike))), p.largest_tilt_rad)
    tilted_m = p.placement_sd_per_tilt_m * tilted_rad
    turned_m = p.placement_sd_per_turn_m * 2.0 * math.sin(0.5 * turned_rad)
    return float(p.placement_sd_m**2 + tilted_m**2 + turned_m**2)


@compiled
def close_stride(
    s: StateRecord,
    o: OutcomeRecord,
    p: ParametersRecord,
    m: int,
    anchor: int,
    peak_speed_m_s: float,
) -> None:
    """Smooth the stretch up to slot ``m``, write the increment up to slot ``anchor``.

    Of what ``kind`` it is, who calls has written: a constant among the arguments would have this
    compiled anew for each.
    The next begins with position and heading known by definition. The covariance of (north, east,
    down, heading) is given the heading at the stride's start: ``P_zz − P_zψ·P_ψψ⁻¹·P_ψz``.
    """
    mask = CAPACITY - 1
    smooth_stride(s.history, s.path, s.boundary + 1, m)
    end = s.history[anchor & mask, FILTERED + 3 : FILTERED + 7].copy()
    turn_nav(end, 0.0, 0.0, s.path[anchor & mask, 3])
    o.first_slot, o.last_slot = s.boundary + 1, m
    o.start_slot, o.end_slot = s.anchor, anchor
    o.start_ns, o.end_ns = s.time_ns[s.anchor & mask], s.time_ns[anchor & mask]
    o.heading_change_rad = turn_about_down(s.anchor_quat_wxyz, end)
    s.heading_rad += o.heading_change_rad
    o.heading_rad = s.heading_rad
    o.highest_m = o.lowest_m = 0.0
    for slot in range(s.boundary + 1, anchor + 1):
        height = s.anchor_position_m[2] - s.path[slot & mask, 2]
        o.highest_m, o.lowest_m = max(o.highest_m, height), min(o.lowest_m, height)
    write_lean(s, o, s.boundary + 1, anchor)
    for c in range(3):
        o.displacement_m[c] = s.path[anchor & mask, c] - s.anchor_position_m[c]
        s.anchor_position_m[c] = s.path[anchor & mask, c]
    placed_m2 = placement_variance(s.anchor_quat_wxyz, end, o.heading_change_rad, p)
    s.anchor_quat_wxyz[:] = o.end_quat_wxyz[:] = end
    o.peak_speed_m_s, o.rolling_height_m = peak_speed_m_s, s.rolling_height_m
    o.statistic = s.statistic[anchor & mask]
    write_increment_covariance(s.covariance, o.covariance, p, s.swing_innovation)
    o.covariance[0, 0] += placed_m2
    o.covariance[1, 1] += placed_m2
    s.swing_innovation = 0.0
    corrected_m = s.corrected_down_m_s * 1e-9 * (o.end_ns - o.start_ns)
    o.covariance[2, 2] += p.down_placement_sd_m**2 + (p.down_correction_share * corrected_m) ** 2
    s.corrected_down_m_s = 0.0
    s.boundary, s.anchor, s.candidate = m, anchor, -1


@compiled
def close_at_candidate(s: StateRecord, o: OutcomeRecord, p: ParametersRecord, m: int) -> None:
    """Close the stride up to the candidate. After standing, the next swing may have begun."""
    peak_m_s = s.candidate_peak_m_s
    o.kind = STANDING
    if peak_m_s > p.moving_speed_m_s:
        o.kind = STRIDE
        s.peak_speed_m_s = 0.0
    close_stride(s, o, p, m, s.candidate, peak_m_s)


@compiled
def write_increment_covariance(
    covariance: NDArray[np.float64],
    out: NDArray[np.float64],
    p: ParametersRecord,
    swing_innovation: float,
) -> None:
    """Write the increment's 4×4 into ``out``; reset position, clone the heading anew.

    The filter's own covariance is scaled, and the more the more its velocity was found off when the
    swing ended: ``swing_innovation`` is the mean square of that over what the filter had expected.
    So a stride over which a sensor did worse than any noise it is known for is told as less sure.
    Noise that must be large while a foot swings makes the filter doubt a place more than the two
    stances that hold it at its ends leave to be doubted; a heading has no such hold. All was set so
    that, with :func:`placement_variance`, the 95 % ellipse holds 95 % of the strides in every gait.
    Height errs otherwise: most where a boot that slowly rose or sank was taken for standing, which
    shows in how much of its vertical speed was corrected away (:func:`close_stride` adds that).
    """
    known = covariance[START_HEADING, START_HEADING]
    surprise = min(swing_innovation, p.largest_innovation)
    level = math.sqrt(p.level_covariance_factor + p.level_innovation_factor * surprise)
    heading = math.sqrt(p.heading_covariance_factor + p.heading_innovation_factor * surprise)
    scale = (level, level, math.sqrt(p.down_covariance_factor), heading)
    for i in range(4):
        a = i if i < 3 else HEADING
        for j in range(4):
            b = j if j < 3 else HEADING
            out[i, j] = covariance[a, b]
            if known > 0.0:
                out[i, j] -= covariance[a, START_HEADING] * covariance[b, START_HEADING] / known
            out[i, j] *= scale[i] * scale[j]
    for i in range(STATES):
        for c in range(3):
            covariance[c, i] = covariance[i, c] = 0.0
    for i in range(STATES):
        covariance[START_HEADING, i] = covariance[HEADING, i]
    for i in range(STATES):
        covariance[i, START_HEADING] = covariance[i, HEADING]


@compiled
def advance(s: StateRecord, o: OutcomeRecord, p: ParametersRecord, m: int) -> bool:
    """Filter slot ``m`` and close the stride it completes, if any; returns whether.

    A stride ends at the stillest believed slot since the foot moved, once ``settle`` has passed.
    """
    if filter_slot(s, p, m):
        value = s.statistic[m & (CAPACITY - 1)]
        moved = s.peak_speed_m_s > p.moving_speed_m_s or m - s.anchor >= p.standing
        if moved if s.candidate < 0 else value < s.candidate_statistic:
            s.candidate, s.candidate_statistic = m, value
            s.candidate_peak_m_s = s.peak_speed_m_s
    if s.candidate >= 0 and m - s.candidate >= p.settle:
        close_at_candidate(s, o, p, m)
        return True
    if m - s.boundary >= p.longest:
        o.kind = UNFINISHED
        close_stride(s, o, p, m, m, s.peak_speed_m_s)
        s.peak_speed_m_s = 0.0
        return True
    return False


@compiled
def take_statistic(s: StateRecord, p: ParametersRecord, centre: int) -> None:
    """Compute the statistic of slot ``centre``, and follow the stops long enough for ZARU."""
    value = shoe_statistic(
        s.samples,
        max(0, centre - p.half_window),
        min(centre, p.half_window) + p.half_window + 1,
        p.gravity_m_s2,
        p.force_scale_m_s2,
        p.rate_scale_rad_s,
    )
    s.statistic[centre & (CAPACITY - 1)] = value
    b = s.rate_bias_rad_s
    of_bias = (b[0] * b[0] + b[1] * b[1] + b[2] * b[2]) / p.rate_scale_rad_s**2
    if value - of_bias >= p.zero_rate_limit:
        s.still_since = -1
    elif s.still_since < 0:
        s.still_since = centre
    if s.still_since >= 0 and centre - s.still_since >= p.zero_rate:
        s.zero_rate_first, s.zero_rate_last = s.still_since, centre


@compiled
def mend_gap(state: State, parameters: Parameters, first: int, last: int) -> float:
    """Bridge slots ``first … last`` with what is now known on both sides (see gap_bridging.py).

    The slots must still lie ahead of the filter. Returns the disagreement of the bridge.
    """
    s, p = state[0], parameters[0]
    disagreement = bridge_gap(s.samples, first, last, s.head, p)
    for centre in range(first - p.half_window, min(last + p.half_window, s.filtered) + 1):
        take_statistic(s, p, centre)
    return disagreement


@compiled
def bridge_pending(state: State, parameters: Parameters) -> None:
    """Bridge the latest gap with what has come after it, unless the filter is in it already."""
    s, p = state[0], parameters[0]
    first, last = s.gap[0], s.gap[1]
    if first >= 0 and s.head - p.half_window - p.look_ahead <= first:
        mend_gap(state, parameters, first, last)
    s.gap[:] = -1


@compiled
def foresee_gap(
    state: State, parameters: Parameters, missing: int, after: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return rows (``missing``×6) to hold the places of samples missing before ``after`` (6).

    What will be bridged before the filter comes to it is a straight line meanwhile; in a longer gap
    the filter comes to the first rows at once, and all must be as good as they can be by then.
    A gap before it that still waits to be bridged waits no longer.
    """
    bridge_pending(state, parameters)
    s, p = state[0], parameters[0]
    first, last = s.head, s.head + missing - 1
    for slot in range(first, last + 1):
        s.samples[slot & (CAPACITY - 1), STEP] = 1e-9 * s.period_ns
    s.samples[(last + 1) & (CAPACITY - 1), :STEP] = after
    if missing < p.half_window + p.look_ahead:
        draw_line(s.samples, first, last)
    else:
        bridge_gap(s.samples, first, last, last + 2, p)
    rows = np.empty((missing, STEP))
    for slot in range(first, last + 1):
        rows[slot - first] = s.samples[slot & (CAPACITY - 1), :STEP]
    return rows


@compiled
def mend_sample(
    state: State,
    parameters: Parameters,
    slot: int,
    force_m_s2: NDArray[np.float64],
    rate_rad_s: NDArray[np.float64],
) -> None:
    """Put a sample that came late into the bridged ``slot`` it belongs to, ahead of the filter.

    What is left of a gap that waits to be bridged goes on waiting, but for what is before a sample
    in its midst.
    """
    s, p = state[0], parameters[0]
    row = s.samples[slot & (CAPACITY - 1)]
    row[0:3] = force_m_s2
    row[3:6] = rate_rad_s
    row[BRIDGED:] = 0.0
    for centre in range(slot - p.half_window, min(slot + p.half_window, s.filtered) + 1):
        take_statistic(s, p, centre)
    first, last = s.gap[0], s.gap[1]
    if not first <= slot <= last:
        return
    if first < slot < last:
        s.gap[1] = slot - 1
        bridge_pending(state, parameters)
    if slot == first == last:
        s.gap[:] = -1
    elif slot < last:
        s.gap[0], s.gap[1] = slot + 1, last
    else:
        s.gap[1] = last - 1


@compiled
def step(
    state: State,
    outcome: Outcome,
    parameters: Parameters,
    time_ns: int,
    fx: float,
    fy: float,
    fz: float,
    wx: float,
    wy: float,
    wz: float,
    dt_s: float,
    bridged: bool,
) -> bool:
    """Take one sample in; True when ``outcome`` has been given a new stride.

    Specific force in m/s² and angular rate in rad/s, sensor axes; ``dt_s`` since the sample
    before; ``bridged`` says that the sample only holds the place of a missing one.
    """
    s, o, p = state[0], outcome[0], parameters[0]
    n = s.head
    slot = n & (CAPACITY - 1)
    row = s.samples[slot]
    row[0], row[1], row[2], row[3], row[4], row[5] = fx, fy, fz, wx, wy, wz
    row[STEP] = dt_s
    row[BRIDGED:] = 0.0
    if bridged:
        row[BRIDGED] = row[DOUBT] = row[RATE_DOUBT] = 1.0
    s.time_ns[slot] = time_ns
    s.head = n + 1
    watch_flat_tops(s.samples, s.flat_tops, s.fastest_rad_s, n, p)
    centre = n - p.half_window
    if centre < 0:
        return False
    take_statistic(s, p, centre)
    s.filtered = centre
    m = centre - p.look_ahead
    return m >= 1 and advance(s, o, p, m)


@compiled
def finish(state: State, outcomes: Outcome, parameters: Parameters) -> int:
    """Close the strides still ahead of the filter: no more samples will come, or not in time.

    Stillness is judged with what there is to look ahead to. ``outcomes`` holds ``MOST_HELD``;
    returns how many were written.
    """
    s, p = state[0], parameters[0]
    found = 0
    for m in range(max(1, s.filtered - p.look_ahead + 1), s.filtered + 1):
        if advance(s, outcomes[found], p, m):
            found += 1
    if s.candidate >= 0:
        close_at_candidate(s, outcomes[found], p, s.filtered)
        found += 1
    return found


@compiled
def run(
    state: State,
    outcomes: Outcome,
    parameters: Parameters,
    time_ns: NDArray[np.int64],
    force_m_s2: NDArray[np.float64],
    rate_rad_s: NDArray[np.float64],
    dt_s: NDArray[np.float64],
    bridged: NDArray[np.bool_],
    path_m: NDArray[np.float64],
) -> int:
    """The online step over n samples; returns how many strides were written to ``outcomes``.

    ``path_m`` (n×3, or of no rows) is given the smoothed path of every published stride.
    """
    found = 0
    for i in range(force_m_s2.shape[0]):
        f, w = force_m_s2[i], rate_rad_s[i]
        one = outcomes[found : found + 1]
        if step(
            state, one, parameters, time_ns[i], f[0], f[1], f[2], w[0], w[1], w[2], dt_s[i],
            bridged[i],
        ):  # fmt: skip
            o = one[0]
            if path_m.shape[0] > 0:
                for slot in range(o.first_slot, o.last_slot + 1):
                    for c in range(3):
                        path_m[slot, c] = state[0].path[slot & (CAPACITY - 1), c]
            found += 1
    return found
