"""What corrects a vehicle's speed, level and forward direction, once a second.

Each is a fact of driving: a standstill, no sliding sideways, no speeding up for ever, pitching more
than rolling, and the road's echo along the wheelbase.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from edge_agent.inertial.forward_axis import AXIS_SD_RAD, forward_axes
from edge_agent.inertial.vehicle_filter import (
    BIAS,
    FORWARD,
    LATE,
    SPEED,
    STATES,
    WHEELBASE,
    Array,
    VehicleFilter,
)
from edge_agent.inertial.vehicle_memory import Mean, Memory, mean_of
from edge_agent.inertial.wheelbase_echo import Vibration, echo_log_likelihoods
from shared.maths.angles import wrap_rad

STILL_M_S = 0.02
STILL_M_S2 = 0.05
STILL_RAD_S = math.radians(0.05)
"""Standing, speed, acceleration and rate are known to be zero as well as that."""

CENTRIPETAL_SD_M_S2 = 0.5
"""Of the mean acceleration to the right over a second against yaw rate × speed: camber, sway."""

USUAL_VARIANCE_M2_S4 = 2.0 * 8.0 * 0.8**2
"""Of a second's acceleration taken as none: driving has 0.8 m/s², and changes its mind in 8 s."""

USUAL_M_S = 12.0
USUAL_SD_M_S = math.sqrt(2.0 * 30.0) * 10.0
"""Likewise of speed: give or take 10 m/s, and for half a minute."""

DOUBTED_FORWARD_RAD = math.radians(8.0)
FACED_S = 2.0
"""Forward, known worse than that, is taken from vibration once there is so much of it."""

HALF_KNOWN_RAD = math.radians(60.0)
"""Forward known no worse is not turned round."""

GATE_SDS = 3.0

LOST_SD_M_S = 1.0
HEARD_S = 4.0
CONCLUSIVE = 0.5
"""Of speed known worse than the first, echoes of up to four seconds are weighed together, and
believed only when they leave no more than this share of its standard deviation."""

FASTEST_M_S = 50.0
ODD_SHARE = 0.01
"""How likely a vehicle of which nothing is known goes backwards, or faster than that."""

GRID_SDS = 4.0
LEAST_VARIANCE_M2_S2 = 1e-6
GRID_STEP_M_S = 0.15
FEWEST_CANDIDATES, MOST_CANDIDATES = 41, 401


def stand(state: VehicleFilter, mean: Mean, rate_rad_s: Array) -> None:
    """Zero-velocity update: no speed, no acceleration, and the gyroscope reads its zero.

    ``mean`` is of the second, ``rate_rad_s`` (3,) the mean rate read in it, in sensor axes.
    """
    know_speed(state, 0.0, STILL_M_S)
    state.measure(-mean.forward_m_s2, state.along(), STILL_M_S2**2)
    state.measure(-mean.right_m_s2, state.across(), STILL_M_S2**2)
    for axis, read_rad_s in enumerate(rate_rad_s.tolist()):
        error_rad_s = read_rad_s - state.bias_rad_s[axis]
        state.measure(error_rad_s, _unit(BIAS + axis), STILL_RAD_S**2)


def know_speed(state: VehicleFilter, speed_m_s: float, sd_m_s: float) -> None:
    """Use a speed that somebody knows."""
    state.measure(speed_m_s - state.speed_m_s, _unit(SPEED), sd_m_s**2)


def compare_turn(state: VehicleFilter, mean: Mean) -> None:
    """Use that a vehicle does not slide: acceleration to the right is yaw rate × speed.

    In turns this tells speed, in braking which way is forward, and else the level.
    """
    slope = -state.across()
    slope[SPEED] = mean.yaw_rad_s
    slope[FORWARD] = mean.forward_m_s2
    error_m_s2 = mean.right_m_s2 - state.speed_m_s * mean.yaw_rad_s
    state.measure(error_m_s2, slope, CENTRIPETAL_SD_M_S2**2)


def suppose_usual(state: VehicleFilter, mean: Mean) -> None:
    """Use that nobody speeds up, or brakes, for ever: it ties the level down in the long run."""
    state.measure(-mean.forward_m_s2, state.along(), USUAL_VARIANCE_M2_S4)
    know_speed(state, USUAL_M_S, USUAL_SD_M_S)


def face(state: VehicleFilter, memory: Memory) -> None:
    """Where forward is in doubt, take it from how the vehicle has shaken since the last slip."""
    if state.forward_sd_rad < DOUBTED_FORWARD_RAD:
        return
    columns = memory.columns(memory.slipped_s)
    if len(columns) < 2 or columns[-1, 0] - columns[0, 0] < FACED_S:
        return
    period_s = float(columns[-1, 0] - columns[0, 0]) / (len(columns) - 1)
    axis, _ = forward_axes(period_s, columns[:, 3], columns[:, 4], columns[:, 8])
    off_rad = wrap_rad(axis.heading_rad)
    if state.forward_sd_rad < HALF_KNOWN_RAD:
        off_rad = math.remainder(off_rad, math.pi)
    if abs(off_rad) < GATE_SDS * state.forward_sd_rad:
        state.measure(off_rad, _unit(FORWARD), AXIS_SD_RAD**2)


@dataclass
class EchoListener:
    """Weighs the speeds there may be by how the road echoes along the wheelbase. Plain state."""

    heard_s: float = -math.inf
    """Until when echoes have been used."""

    evidence: float = 0.0
    """Log-likelihood of all echoes used, against there being none."""

    def listen(self, state: VehicleFilter, memory: Memory, begin_s: float) -> None:
        """Correct ``state`` by the echoes after ``begin_s``, and the way in ``memory``."""
        now_s = memory.moments[-1].time_s
        slope = _unit(SPEED)
        slope[WHEELBASE] = -state.speed_m_s / state.wheelbase_m
        slope[LATE] = -(state.speed_m_s**2) / state.wheelbase_m
        tied = state.covariance @ slope
        variance = float(slope @ tied)
        if variance < LEAST_VARIANCE_M2_S2:
            return
        sd_m_s = math.sqrt(variance)
        ratio_per_s = float(state.along() @ tied) / variance
        lost = sd_m_s > LOST_SD_M_S
        if lost:
            begin_s = min(begin_s, max(self.heard_s, now_s - HEARD_S))
        errors_m_s = _candidates(sd_m_s)
        rows = memory.columns()
        heard = echo_log_likelihoods(
            Vibration(rows[:, 0], rows[:, 2], rows[:, 3], rows[:, 4]),
            begin_s,
            (state.wheelbase_m, state.late_s),
            errors_m_s,
            ratio_per_s,
        )
        weights = _prior(errors_m_s, sd_m_s, state.speed_m_s)
        loudest = float(heard.max())
        weights *= np.exp(heard - loudest)
        total = float(weights.sum())
        weights /= total
        mean_m_s = float(weights @ errors_m_s)
        spread = float(weights @ np.square(errors_m_s - mean_m_s))
        if lost and spread > (CONCLUSIVE * sd_m_s) ** 2:
            return
        self.heard_s = now_s
        self.evidence += loudest + math.log(total)
        state.replace_along(slope, mean_m_s, max(spread, (GRID_STEP_M_S / 4.0) ** 2))
        memory.mend(mean_m_s, ratio_per_s)


def mean_since(memory: Memory, begin_s: float) -> Mean | None:
    """Return the mean since ``begin_s``; ``None`` if the sensor slipped for half of it or more."""
    moments = memory.after(begin_s)
    if 2 * sum(one.slips for one in moments) >= len(moments):
        return None
    return mean_of(moments)


def _candidates(sd_m_s: float) -> Array:
    """Return errors of speed (k,), evenly from the least likely to the greatest."""
    count = round(2.0 * GRID_SDS * sd_m_s / GRID_STEP_M_S)
    count = min(max(count, FEWEST_CANDIDATES), MOST_CANDIDATES)
    return sd_m_s * np.linspace(-GRID_SDS, GRID_SDS, count)


def _prior(errors_m_s: Array, sd_m_s: float, speed_m_s: float) -> Array:
    """Return how likely errors (k,) are before anything is heard; they sum up to one."""
    weights: Array = np.exp(-0.5 * np.square(errors_m_s / sd_m_s))
    candidates_m_s = speed_m_s + errors_m_s
    weights[(candidates_m_s < 0.0) | (candidates_m_s > FASTEST_M_S)] *= ODD_SHARE
    weights /= weights.sum()
    return weights


def _unit(place: int) -> Array:
    slope = np.zeros(STATES)
    slope[place] = 1.0
    return slope
