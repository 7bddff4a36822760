"""One slot of the boot's filter: predict, judge stillness, update, remember for the smoother."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from edge_agent.inertial.boot_state import StateRecord
from edge_agent.inertial.eskf_parameters import CAPACITY, ParametersRecord
from edge_agent.inertial.foot_mechanisation import rotation_matrix, turn_body, turn_nav
from edge_agent.inertial.sample_ring import BRIDGED, RATE, STEP
from edge_agent.inertial.stride_smoothing import (
    COVARIANCE_ROWS,
    FILTERED,
    UPDATE_COUNT,
    UPDATE_WIDTH,
    UPDATES,
)
from edge_agent.inertial.zero_velocity import MOVING, STRONG, stillness_class
from edge_agent.inertial.zupt_filter import (
    HEADING,
    RATE_BIAS,
    ROLLING_HEIGHT,
    STATES,
    add_process_noise,
    propagate_covariance,
    scalar_update,
    velocity_innovation,
    widen_covariance,
)
from shared.compiled import compiled

STOP_PARTS = 5
"""A stop is looked at in blocks, and a block in so many parts."""


@compiled
def predict(s: StateRecord, p: ParametersRecord, m: int, rate: NDArray[np.float64]) -> None:
    """Carry the filter from slot ``m − 1`` to ``m``; writes the bias-free ``rate`` (3,)."""
    mask = CAPACITY - 1
    now, before = s.samples[m & mask], s.samples[(m - 1) & mask]
    row = s.history[m & mask]
    force = np.empty(3)
    nav_from_body = np.empty((3, 3))
    for c in range(3):
        force[c] = 0.5 * (now[c] + before[c]) - s.force_bias_m_s2[c]
        rate[c] = 0.5 * (now[RATE + c] + before[RATE + c]) - s.rate_bias_rad_s[c]
    dt = now[STEP]
    half = 0.5 * dt
    turn_body(s.quat_wxyz, half * rate[0], half * rate[1], half * rate[2])
    rotation_matrix(s.quat_wxyz, nav_from_body)
    turn_body(s.quat_wxyz, half * rate[0], half * rate[1], half * rate[2])
    row[0] = dt
    for c in range(3):
        axis = nav_from_body[c]
        gained = dt * (axis[0] * force[0] + axis[1] * force[1] + axis[2] * force[2])
        row[1 + c] = gained
        if c == 2:
            gained += dt * p.gravity_m_s2
        s.position_m[c] += dt * (s.velocity_m_s[c] + 0.5 * gained)
        s.velocity_m_s[c] += gained
        for j in range(3):
            row[4 + 3 * c + j] = -dt * axis[j]
    propagate_covariance(s.covariance, row)
    add_process_noise(s.covariance, row, force, rate, now, before, p)


@compiled
def innovation(s: StateRecord, roll: NDArray[np.float64], variance: float) -> float:
    """Squared Mahalanobis distance of the filter's velocity from that of a foot at stance."""
    residual = np.empty(3)
    for c in range(3):
        residual[c] = s.rolling_height_m * roll[c] - s.velocity_m_s[c]
    return velocity_innovation(s.covariance, variance, residual)


@compiled
def believes_still(
    s: StateRecord, p: ParametersRecord, kind: int, roll: NDArray[np.float64], variance: float
) -> bool:
    """Whether a slot's class of stillness is believed.

    A foot swung at a constant velocity is still to the sensors; only the filter's own velocity can
    tell. Time-outs keep a filter gone astray from refusing every stance that would help it; that
    of the weaker class waits for a slow swing, which lasts for long, to have gone its way.
    """
    if kind == MOVING:
        return False
    v = s.velocity_m_s
    speed = math.sqrt(v[0] ** 2 + v[1] ** 2 + v[2] ** 2)
    if speed < p.gate_speed_m_s:
        return True
    excess = innovation(s, roll, variance) / p.gate_innovation
    if excess < 1.0:
        return True
    timeout = p.gate_strong_timeout_s
    if kind != STRONG:
        timeout = max(p.gate_deep_timeout_s, p.gate_deep_way_m / s.peak_speed_m_s)
    if s.since_update_s <= timeout:
        return False
    widen_covariance(s.covariance, min(excess, p.widest))
    return True


@compiled
def record_update(
    row: NDArray[np.float64],
    state: int,
    height_factor: float,
    weight: float,
    gain: NDArray[np.float64],
) -> None:
    """Keep one scalar update for the backward pass."""
    at = UPDATES + UPDATE_WIDTH * int(row[UPDATE_COUNT])
    row[at], row[at + 1], row[at + 2] = state, height_factor, weight
    row[at + 3 : at + UPDATE_WIDTH] = gain
    row[UPDATE_COUNT] += 1.0


@compiled
def stop_rate(
    s: StateRecord, p: ParametersRecord, m: int, mean_rate_rad_s: NDArray[np.float64]
) -> float:
    """Write the mean rate of the block of a stop that ends at slot ``m``; returns its variance.

    Returns zero where no block ends. Who stands sways, some more than others: how far a block's
    mean is off the gyro's bias goes with how far its fifths are off that mean.
    """
    if not (s.zero_rate_first >= 0 and s.zero_rate_first <= m <= s.zero_rate_last):
        return 0.0
    first = max(s.zero_rate_first, s.zero_rate_told + 1)
    part = max(1, p.zero_rate // STOP_PARTS)
    if m - first + 1 < part * STOP_PARTS:
        return 0.0
    s.zero_rate_told = m
    scatter = 0.0
    for c in range(3):
        total = squares = 0.0
        for k in range(STOP_PARTS):
            part_mean = 0.0
            for i in range(part):
                slot = m - part * k - i
                part_mean += s.samples[slot & (CAPACITY - 1), RATE + c] / part
            total += part_mean
            squares += part_mean * part_mean
        mean = total / STOP_PARTS
        mean_rate_rad_s[c] = mean
        scatter += max(0.0, squares / STOP_PARTS - mean * mean)
    return float(p.zero_rate_sd_rad_s**2 + p.sway_share**2 * scatter)


@compiled
def consider_bias_about_down(
    covariance: NDArray[np.float64],
    correction: NDArray[np.float64],
    before: NDArray[np.float64],
    row: NDArray[np.float64],
) -> None:
    """Take back what zero velocity has made of the gyro's bias about down: only stops tell it.

    Velocity sees that bias no more than it sees scale, misalignment and sensitivity to shocks, all
    of them steady errors that no state stands for: walking would learn those in its place. So it
    is a state considered and not corrected (Schmidt 1966): its gain is zero, and its variance,
    which was ``before`` (3×3, of the whole bias), stays what it was.
    """
    down = -row[10:13] / row[0]
    learnt = shift = 0.0
    for i in range(3):
        shift += down[i] * correction[RATE_BIAS + i]
        for j in range(3):
            gone = before[i, j] - covariance[RATE_BIAS + i, RATE_BIAS + j]
            learnt += down[i] * gone * down[j]
    for i in range(3):
        correction[RATE_BIAS + i] -= shift * down[i]
        for j in range(3):
            covariance[RATE_BIAS + i, RATE_BIAS + j] += learnt * down[i] * down[j]


@compiled
def update(
    s: StateRecord,
    p: ParametersRecord,
    m: int,
    roll: NDArray[np.float64],
    variance: float,
) -> None:
    """Zero-velocity update of a rolling foot at slot ``m``, and zero-rate update in long stops.

    ``roll`` is the velocity of the foot per metre of rolling height, ``variance`` of each axis.
    """
    row = s.history[m & (CAPACITY - 1)]
    correction, gain = np.zeros(STATES), np.empty(STATES)
    bias_covariance = s.covariance[12:15, 12:15].copy()
    for c in range(3):
        residual = s.rolling_height_m * roll[c] - s.velocity_m_s[c]
        weight = scalar_update(s.covariance, gain, correction, 3 + c, -roll[c], variance, residual)
        record_update(row, 3 + c, -roll[c], weight, gain)
    consider_bias_about_down(s.covariance, correction, bias_covariance, row)
    mean_rate = np.empty(3)
    still = stop_rate(s, p, m, mean_rate)
    if still > 0.0:
        for c in range(3):
            residual = mean_rate[c] - s.rate_bias_rad_s[c]
            weight = scalar_update(s.covariance, gain, correction, 12 + c, 0.0, still, residual)
            record_update(row, 12 + c, 0.0, weight, gain)
    for c in range(3):
        s.position_m[c] += correction[c]
        s.velocity_m_s[c] += correction[3 + c]
        s.force_bias_m_s2[c] += correction[9 + c]
        s.rate_bias_rad_s[c] += correction[12 + c]
    s.corrected_down_m_s += correction[5]
    s.rolling_height_m += correction[ROLLING_HEIGHT]
    turn_nav(s.quat_wxyz, correction[6], correction[7], correction[8])


@compiled
def allow_for_lift(s: StateRecord, p: ParametersRecord, m: int, gained_m_s: float) -> None:
    """Let a boot that has stood for long gain vertical speed: what it stands on may be a lift.

    A lift gathers speed by some 1 m/s² for a second or two, in which a boot at rest on it is still
    to every other measure. Zero velocity would make an accelerometer's bias of it, and take a
    minute of walking to unlearn. What is not believed to be a bias is noise of this slot.
    """
    gained_m_s += p.gravity_m_s2 * s.history[m & (CAPACITY - 1), 0]
    carried_m_s = p.carried_m_s2 * s.history[m & (CAPACITY - 1), 0]
    if m - s.last_moving >= p.carried_after and abs(gained_m_s) > carried_m_s:
        s.covariance[5, 5] += (p.carried_factor * gained_m_s) ** 2


@compiled
def filter_slot(s: StateRecord, p: ParametersRecord, m: int) -> bool:
    """Predict to slot ``m`` and update there if the foot is believed still; returns whether."""
    mask = CAPACITY - 1
    row = s.history[m & mask]
    row[UPDATE_COUNT] = 0.0
    rate, roll = np.empty(3), np.empty(3)
    predict(s, p, m, rate)
    north, east = row[4:7], row[7:10]
    roll[0] = (east[0] * rate[0] + east[1] * rate[1] + east[2] * rate[2]) / row[0]
    roll[1] = -(north[0] * rate[0] + north[1] * rate[1] + north[2] * rate[2]) / row[0]
    roll[2] = 0.0
    rate_squared = rate[0] ** 2 + rate[1] ** 2 + rate[2] ** 2
    variance = p.velocity_sd_m_s**2 + p.velocity_sd_per_rate_m**2 * rate_squared
    v = s.velocity_m_s
    s.peak_speed_m_s = max(s.peak_speed_m_s, math.sqrt(v[0] ** 2 + v[1] ** 2 + v[2] ** 2))
    s.since_update_s += row[0]
    kind = stillness_class(s.statistic, m, s.filtered, p)
    if s.samples[m & mask, BRIDGED] > 0.0:
        kind = MOVING
    still = believes_still(s, p, kind, roll, variance)
    if still:
        if s.since_update_s > p.swing_s:
            s.swing_innovation = max(s.swing_innovation, innovation(s, roll, variance) / 3.0)
        allow_for_lift(s, p, m, row[3])
        update(s, p, m, roll, variance * p.reference_period_s / row[0])
        s.since_update_s = 0.0
    else:
        s.last_moving = m
    for c in range(3):
        row[FILTERED + c] = s.position_m[c]
        at = COVARIANCE_ROWS + STATES * c
        row[at : at + STATES] = s.covariance[c]
    row[FILTERED + 3 : FILTERED + 7] = s.quat_wxyz
    at = COVARIANCE_ROWS + 3 * STATES
    row[at : at + STATES] = s.covariance[HEADING]
    return still
