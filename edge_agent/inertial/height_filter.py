"""The boot's own rises and sinkings, and the barometer's heights, weighed against one another.

The boot errs by little from stride to stride, but much alike in each; the barometer by much at any
moment, and slowly ever more. Only what both say together can be seen: that the barometer has risen
above the boot's own path. Whether the boot missed it or the air has changed is a matter of how fast
each does so. What no boot can miss in one stride is the air's: a step of the pressure is forgotten.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from edge_agent.inertial.barometer import Barometer, Level
from edge_agent.inertial.boot_state import LOST, STANDING, Stride
from edge_agent.inertial.lift import LiftWatch
from edge_agent.inertial.stride_error import LOST_CLIMB_M_S
from edge_agent.inertial.stride_path import StridePath
from shared.messages import ImuSample
from shared.units import NS_PER_S

Array = NDArray[np.float64]

MISSED, AIR, SLOPE = 0, 1, 2
"""States: how much higher the boot is than it told; what the air adds; what a stride misses."""

SEEN = np.array([1.0, 1.0, 0.0])
SWAPPED = np.array([1.0, -1.0, 0.0])
"""What the barometer shows, and what it cannot: the boot higher by as much as the air is less."""


class HeightSettings(NamedTuple):
    """How fast boot and air go astray, and what cannot be either.

    ``slope_sd_m`` is what every stride of a wearer rises too much or too little alike, and
    ``slope_walk_m`` how it changes from stride to stride. Standing, a boot misses
    ``standing_sd_m`` a second. The air drifts by ``air_walk_m`` in √s; ``scale_sd`` is what its
    temperature makes of a height climbed. An innovation beyond ``step_sigmas`` is a step of the
    pressure, as are those that on average are beyond ``same_sigmas`` to one side over some
    ``same_strides``; one beyond ``weighed_sigmas`` counts less, the larger it is. The barometer is
    looked at over the last ``window_s`` of a stride, in a lift the last ``ride_window_s``; a lift
    goes ``lift_m_s``, give or take, and ``fastest_lift_m_s`` at the most. Beyond ``farthest_m``
    at once nothing is believed, and after ``longest_s`` nothing gets less certain.
    """

    slope_sd_m: float = 0.01
    slope_walk_m: float = 0.0005
    standing_sd_m: float = 0.002
    air_walk_m: float = 0.03
    scale_sd: float = 0.06
    step_sigmas: float = 3.5
    weighed_sigmas: float = 1.5
    same_sigmas: float = 1.3
    same_strides: float = 5.0
    window_s: float = 1.2
    ride_window_s: float = 0.3
    lift_m_s: float = 3.0
    fastest_lift_m_s: float = 20.0
    farthest_m: float = 60.0
    longest_s: float = 600.0
    unknown_sd_m: float = 1e3


class HeightFilter:
    """Takes samples, and strides in order; corrects the strides by the barometer if there is one.

    Without a reading strides are returned as they are.
    """

    def __init__(self, settings: HeightSettings | None = None) -> None:
        self._settings = settings or HeightSettings()
        self._barometer = Barometer()
        self._lift = LiftWatch()
        self._seen = False
        self._state: Array = np.zeros(3)
        sds_m = (0.0, self._settings.unknown_sd_m, self._settings.slope_sd_m)
        self._covariance: Array = np.diag(np.square(sds_m))
        self._told_up_m = 0.0
        """What the boot has told so far, uncorrected."""

        self._weighed_ns: int | None = None
        self._mean_sigmas = 0.0

    def take(self, sample: ImuSample) -> None:
        """Take in a sample, not older than the last."""
        if self._seen:
            self._lift.feel(sample)
        if sample.pressure_pa is None:
            return
        reading = self._barometer.take(sample.time_ns, sample.pressure_pa)
        if reading is not None:
            self._seen = True
            self._lift.take(reading)

    def correct(self, stride: Stride) -> Stride:
        """Return ``stride`` as boot and barometer together have it."""
        if not self._seen or stride.end_ns <= stride.start_ns:
            return stride
        before, before_m2 = self._state.copy(), self._covariance.copy()
        rode = self._lift.rode(stride.start_ns, stride.end_ns)
        transition, noise_m2 = self._predict(stride, rode=rode)
        kept, error_m2 = self._weigh(self._level(stride, rode=rode), stride.end_ns, rode=rode)
        self._told_up_m -= stride.displacement_m[2]
        up_m = float(self._state[MISSED] - before[MISSED])
        # What is told is the change of the estimate: its error is the change of the estimate's.
        change = (kept @ transition)[MISSED] - np.eye(3)[MISSED]
        variance_m2 = change @ before_m2 @ change + (kept @ noise_m2 @ kept.T)[MISSED, MISSED]
        if rode:
            error_m2 += self._doubt_air(up_m)
        return _raised(stride, up_m, float(variance_m2) + error_m2, rode=rode)

    def _predict(self, stride: Stride, *, rode: bool) -> tuple[Array, Array]:
        """Go on to the stride's end; return the transition and the noise that was added."""
        settings = self._settings
        elapsed_s = min((stride.end_ns - stride.start_ns) / NS_PER_S, settings.longest_s)
        transition, noise_m2 = np.eye(3), np.zeros((3, 3))
        told_m2 = stride.covariance[2][2]
        if stride.kind == LOST:
            noise_m2[MISSED, MISSED] = (LOST_CLIMB_M_S * elapsed_s) ** 2
        elif stride.kind == STANDING:
            noise_m2[MISSED, MISSED] = settings.standing_sd_m**2 * elapsed_s
        else:
            transition[MISSED, SLOPE] = 1.0
            noise_m2[SLOPE, SLOPE] = settings.slope_walk_m**2
            # What strides miss alike is a part of what the stride was told to miss.
            alike_m2 = float(self._covariance[SLOPE, SLOPE])
            noise_m2[MISSED, MISSED] = max(told_m2 - alike_m2, 0.25 * told_m2)
        if rode:
            noise_m2[MISSED, MISSED] += (settings.lift_m_s * elapsed_s) ** 2
        climbed_m = settings.scale_sd * stride.displacement_m[2]
        noise_m2[AIR, AIR] = settings.air_walk_m**2 * elapsed_s + climbed_m**2
        self._state = transition @ self._state
        self._covariance = transition @ self._covariance @ transition.T + noise_m2
        return transition, noise_m2

    def _level(self, stride: Stride, *, rode: bool) -> Level | None:
        """Return how much higher the barometer is at the stride's end than the boot told."""
        settings = self._settings
        if self._lift.doubtful and not rode:
            return None
        window_s = settings.ride_window_s if rode else settings.window_s
        from_ns = max(stride.start_ns, stride.end_ns - round(window_s * NS_PER_S))
        level = self._barometer.above(stride.path if len(stride.path) else _even(stride), from_ns)
        if level is None:
            return None
        return Level(level.height_m - self._told_up_m, level.variance_m2)

    def _weigh(self, level: Level | None, now_ns: int, *, rode: bool) -> tuple[Array, float]:
        """Update by ``level``; return ``I − K·H``, and the variance that its error brings."""
        if level is None:
            return np.eye(3), 0.0
        settings = self._settings
        innovation_m = level.height_m - float(self._state @ SEEN)
        expected_m2 = float(SEEN @ self._covariance @ SEEN)
        error_m2 = level.variance_m2
        sigmas = innovation_m / math.sqrt(expected_m2 + error_m2)
        bounded = min(max(sigmas, -settings.step_sigmas), settings.step_sigmas)
        self._mean_sigmas += (bounded - self._mean_sigmas) / settings.same_strides
        weighed_ns, self._weighed_ns = self._weighed_ns, now_ns
        since_s = 0.0 if weighed_ns is None else (now_ns - weighed_ns) / NS_PER_S
        if rode:
            self._mean_sigmas = 0.0
            step = abs(innovation_m) > settings.fastest_lift_m_s * since_s
        else:
            step = (
                abs(sigmas) > settings.step_sigmas or abs(self._mean_sigmas) > settings.same_sigmas
            )
        if step or abs(innovation_m) > settings.farthest_m:
            self._state[AIR] += innovation_m
            self._covariance[AIR, AIR] += innovation_m**2
            return np.eye(3), 0.0
        error_m2 *= max(1.0, abs(sigmas) / settings.weighed_sigmas) ** 2
        gain = self._covariance @ SEEN / (expected_m2 + error_m2)
        kept = np.eye(3) - np.outer(gain, SEEN)
        self._state = self._state + gain * innovation_m
        self._covariance = kept @ self._covariance @ kept.T + error_m2 * np.outer(gain, gain)
        return kept, float(gain[MISSED]) ** 2 * error_m2

    def _doubt_air(self, up_m: float) -> float:
        """Take into account that a ride is known by the air alone, as warm as it may be."""
        doubt_m2 = (self._settings.scale_sd * up_m) ** 2
        self._covariance += doubt_m2 * np.outer(SWAPPED, SWAPPED)
        return doubt_m2


def _even(stride: Stride) -> StridePath:
    """Return the straight way of a stride of which no other is known."""
    ends_ns = np.array([stride.start_ns, stride.end_ns])
    return StridePath(ends_ns, np.array([(0.0, 0.0, 0.0), stride.displacement_m]))


def _raised(stride: Stride, up_m: float, variance_m2: float, *, rode: bool) -> Stride:
    """Return ``stride`` with ``up_m`` more of rise, evenly over its time, known so well."""
    north_m, east_m, down_m = stride.displacement_m
    path = stride.path
    if len(path):
        share = (path.time_ns - path.time_ns[0]) / (path.time_ns[-1] - path.time_ns[0])
        position_m = path.position_m.copy()
        position_m[:, 2] -= share * up_m
        path = StridePath(path.time_ns, position_m)
    covariance = np.array(stride.covariance)
    if covariance[2, 2] > 0.0:
        scale = math.sqrt(variance_m2 / covariance[2, 2])
        covariance[2, :] *= scale
        covariance[:, 2] *= scale
    covariance[2, 2] = variance_m2
    return stride._replace(
        displacement_m=(north_m, east_m, down_m - up_m),
        covariance=tuple(map(tuple, covariance.tolist())),
        path=path,
        carried_down_m=-up_m if rode else 0.0,
    )
