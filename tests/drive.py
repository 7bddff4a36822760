"""A car on a rough road, as a phone on its dashboard reads it: it heaves, pitches and rolls.

Another model than what the mounts suppose: axles on springs and dampers over a profile that is a
random walk, tyres that smooth it, squat, slopes, an engine, noise, and biases.
"""

from __future__ import annotations

from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator
from scipy.signal import lfilter, lsim
from scipy.spatial.transform import Rotation

from edge_agent.sources.recording import Recording

Array: TypeAlias = NDArray[np.float64]
Profile: TypeAlias = tuple[tuple[float, float], ...]

FINE_HZ, RATE_HZ = 500.0, 104.0
GRAVITY_M_S2 = 9.80665
FRONT_M, WHEELBASE_M = 1.25, 2.7
DASHBOARD_M, HEIGHT_M = 0.8, 0.6


class Drive(NamedTuple):
    """What the phone reads in forward-right-down axes, and the truth at each sample."""

    recording: Recording
    speed_m_s: Array
    heading_rad: Array


def drive(speed: Profile, yaw: Profile = ((0.0, 0.0), (1.0, 0.0)), seed: int = 0) -> Drive:
    """Return a drive of ``speed`` and ``yaw`` rate, by (time, value) knots joined smoothly.

    Below 0 it reverses.
    """
    chance = np.random.default_rng(seed)
    time_s = np.arange(0.0, speed[-1][0], 1.0 / FINE_HZ)
    speed_m_s = _joined(speed, time_s)
    yaw_rad_s = _joined(yaw, time_s)
    heading_rad = np.cumsum(yaw_rad_s) / FINE_HZ
    way_m = np.cumsum(speed_m_s) / FINE_HZ
    way_m -= min(0.0, float(way_m.min()))
    heave_m_s2, pitch_rad, roll_rad = _body(way_m, chance)
    roll_rad = roll_rad + 0.003 * speed_m_s * yaw_rad_s
    pitch_acceleration = _slope(_slope(pitch_rad))
    level_from_car = Rotation.from_euler("YX", np.column_stack((pitch_rad, roll_rad)))
    level = np.column_stack(
        (_slope(speed_m_s), speed_m_s * yaw_rad_s, np.full(len(time_s), -GRAVITY_M_S2))
    )
    force_m_s2 = level_from_car.inv().apply(level)
    force_m_s2[:, 0] += HEIGHT_M * pitch_acceleration
    force_m_s2[:, 1] -= HEIGHT_M * _slope(_slope(roll_rad))
    force_m_s2[:, 2] -= heave_m_s2 + DASHBOARD_M * pitch_acceleration
    rate_rad_s = level_from_car.inv().apply(
        np.column_stack((np.zeros(len(time_s)), np.zeros(len(time_s)), yaw_rad_s))
    )
    rate_rad_s[:, 0] += _slope(roll_rad)
    rate_rad_s[:, 1] += _slope(pitch_rad)
    at_s = np.arange(0.05, time_s[-1] - 0.05, 1.0 / RATE_HZ)
    recording = Recording(
        np.rint(at_s * 1e9).astype(np.int64),
        _sampled(force_m_s2, time_s, at_s) + chance.normal(0.0, 0.03, (len(at_s), 3)),
        _sampled(rate_rad_s, time_s, at_s)
        + chance.normal(0.0, 0.002, (len(at_s), 3))
        + [0.002, -0.003, 0.001],
    )
    return Drive(
        recording, np.interp(at_s, time_s, speed_m_s), np.interp(at_s, time_s, heading_rad)
    )


def _body(way_m: Array, chance: np.random.Generator) -> tuple[Array, Array, Array]:
    """Return heave (m/s²), pitch and roll (rad) of the body over the way made (n,)."""
    step_m = 0.02
    count = int((way_m[-1] + WHEELBASE_M + 5.0) / step_m)
    at_m = step_m * np.arange(count) - WHEELBASE_M - 1.0
    kept = np.exp(-step_m / 8.0)
    walks = lfilter([1.1e-3], [1.0, -kept], chance.normal(size=(2, count)))
    middle, tilt = walks[0], 0.3 * walks[1]
    smoothing = 1.0 - np.exp(-1.0 / FINE_HZ / 0.008)

    def under(profile: Array, back_m: float) -> Array:
        tyre: Array = lfilter(
            [smoothing], [1.0, smoothing - 1.0], np.interp(way_m - back_m, at_m, profile)
        )
        return tyre

    front, rear = under(middle, 0.0), under(middle, WHEELBASE_M)
    rear_m = WHEELBASE_M - FRONT_M
    stiff, damped, inertia = (2.0 * np.pi * 1.4) ** 2 / 2.0, 2.0 * np.pi * 1.4 * 0.35, 1.9
    row = np.array([1.0, FRONT_M]), np.array([1.0, -rear_m])
    push = [np.outer([1.0, axle[1] / inertia], axle) for axle in row]
    both = push[0] + push[1]
    motion = np.zeros((4, 4))
    motion[:2, 2:] = np.eye(2)
    motion[2:, :2], motion[2:, 2:] = -stiff * both, -damped * both
    gain = np.zeros((4, 4))
    for axle, place in ((0, 0), (1, 2)):
        gain[2:, place] = stiff * row[axle] / [1.0, inertia]
        gain[2:, place + 1] = damped * row[axle] / [1.0, inertia]
    inputs = np.column_stack((front, _slope(front), rear, _slope(rear)))
    fine_s = np.arange(len(way_m)) / FINE_HZ
    _, _, states = lsim((motion, gain, np.eye(4), np.zeros((4, 4))), inputs, fine_s)
    bank = under(tilt, 0.0) + under(tilt, WHEELBASE_M)
    rolls = (2.0 * np.pi * 1.7) ** 2, 2.0 * np.pi * 1.7 * 0.6
    rolling = (
        np.array([[0.0, 1.0], [-rolls[0], -rolls[1]]]),
        np.array([[0.0, 0.0], rolls]),
        np.eye(2),
        np.zeros((2, 2)),
    )
    _, _, roll = lsim(rolling, np.column_stack((bank, _slope(bank))), fine_s)
    return _slope(states[:, 2]), states[:, 1], roll[:, 0]


def _joined(profile: Profile, time_s: Array) -> Array:
    """Return the profile at each time, held after its last knot."""
    at_s, values = np.array(profile).T
    joined: Array = PchipInterpolator(at_s, values)(np.minimum(time_s, at_s[-1]))
    return joined


def _slope(signal: Array) -> Array:
    slope: Array = np.gradient(signal) * FINE_HZ
    return slope


def _sampled(signal: Array, time_s: Array, at_s: Array) -> Array:
    """Return a signal (n, 3) as a sensor samples it, which averages over its period."""
    kernel = np.ones(4) / 4.0
    return np.column_stack(
        [np.interp(at_s, time_s, np.convolve(signal[:, axis], kernel, "same")) for axis in range(3)]
    )
