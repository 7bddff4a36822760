"""How fast a vehicle goes, by the road: what the front axle meets, the rear axle meets later.

An unevenness pitches the body one way under the front axle and the other way under the rear, and
rolls it the same way under both. So pitch and roll rate hold an echo of themselves, one wheelbase
later along the road: ``wheelbase / speed`` seconds. The echo tells speed itself, not its change,
and needs no satellite, map or wheel sensor; a phone's gyroscope hears it at any angle.

Departure from the literature on chassis vibration, which tracks the wheels' own turning: on a phone
that line is faint, and has to be told from the engine's.
"""

from __future__ import annotations

import math
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

Array: TypeAlias = NDArray[np.float64]

ORDER = 6
"""Of the prediction that makes vibration white: the body's and the suspension's resonances."""

LARGEST_WHITE = 3.0
"""In standard deviations: one pothole counts no more than that."""

PITCH_ECHO = ((-0.016, 0.10), (0.0, -0.22))
ROLL_ECHO = ((-0.002, 0.14),)
"""The echo: (s after it is due, share of the front axle's unevenness). Pitch turns its sign.

Pitch has a forerunner and comes late, by some ``LATE_S`` that differ from car to car, for what is
made white in the front axle's response is not so in the rear's.
"""

LATE_S = 0.010

SLOWEST_M_S = 0.7
"""Slower, the window is over before the rear axle comes to where the front one was."""

LOUDNESS = (0.0, 0.5, 1.0)
"""The echo may be as strong as told above, half of it, or drowned in noise: each is as likely."""

SHARE_BELIEVED = 0.7
"""Of a log-likelihood: neighbouring samples are not quite independent."""

FEWEST_SAMPLES = 4 * ORDER

SPARSE_S = 0.0135
"""Of samples further apart, by the median, the moments between are interpolated: whitening and the
echo's shape are those of some 100 Hz."""


class Vibration(NamedTuple):
    """The last seconds: ``time_s``, ``travelled_m`` and rates (n,) about the car's own axes."""

    time_s: Array
    travelled_m: Array
    roll_rad_s: Array
    pitch_rad_s: Array


def echo_log_likelihoods(
    vibration: Vibration,
    begin_s: float,
    echo: tuple[float, float],
    speed_error_m_s: Array,
    acceleration_error_per_s: float,
) -> Array:
    """Return how well the samples after ``begin_s`` echo earlier ones, by each speed error (k,).

    ``echo`` is the wheelbase (m) and by how much pitch echoes late (s). Each is the log-likelihood
    against there being no echo, had the speed at the end been greater than told by that error, and
    the acceleration throughout by the error times ``acceleration_error_per_s``. Where a speed has
    no echo inside the window, it is 0.
    """
    wheelbase_m, late_s = echo
    vibration = _dense(vibration)
    time_s = vibration.time_s - vibration.time_s[-1]
    listening = vibration.time_s > begin_s
    if len(time_s) < FEWEST_SAMPLES or not listening.any():
        return np.zeros(len(speed_error_m_s))
    white = [
        (whitened(vibration.pitch_rad_s), PITCH_ECHO, late_s),
        (whitened(vibration.roll_rad_s), ROLL_ECHO, 0.0),
    ]
    travelled_m = vibration.travelled_m - vibration.travelled_m[-1]
    per_error_m = time_s + 0.5 * acceleration_error_per_s * time_s**2
    told = np.zeros(len(speed_error_m_s))
    for row, error_m_s in enumerate(speed_error_m_s.tolist()):
        way_m = travelled_m + error_m_s * per_error_m
        front_m = way_m[listening] - wheelbase_m
        if not _goes_on(way_m, time_s):
            continue
        heard = front_m > way_m[0]
        front_s = np.interp(front_m, way_m, time_s)
        for signal, taps, due_s in white:
            expected = heard * sum(
                share * np.interp(front_s - due_s - after_s, time_s, signal)
                for after_s, share in taps
            )
            told[row] += _log_likelihood(expected, signal[listening])
    return told


def _log_likelihood(expected: Array, heard: Array) -> float:
    """Return that of an echo as ``expected`` (n,), as loud as it may be, against none."""
    likeness = float(np.sum(expected * heard))
    strength = float(np.sum(expected * expected))
    louder = [SHARE_BELIEVED * loud * (likeness - 0.5 * loud * strength) for loud in LOUDNESS]
    return float(np.logaddexp.reduce(louder)) - math.log(len(LOUDNESS))


def _dense(vibration: Vibration) -> Vibration:
    """Return ``vibration`` at twice the rate, if it is sparse."""
    time_s = vibration.time_s
    if len(time_s) < FEWEST_SAMPLES or np.median(np.diff(time_s)) < SPARSE_S:
        return vibration
    # A cubic through times would go back beside a gap.
    return Vibration(
        _doubled(time_s, 0.0),
        _doubled(vibration.travelled_m, 0.0),
        _doubled(vibration.roll_rad_s, 1.0),
        _doubled(vibration.pitch_rad_s, 1.0),
    )


def _doubled(signal: Array, cubic: float) -> Array:
    """Return ``signal`` (n,) with values halfway between, by lines (0) or cubics (1): (2n - 4,)."""
    before, here, there, after = (signal[k : len(signal) - 3 + k] for k in range(4))
    bent = (here - before + there - after) / 16.0
    between = 0.5 * (here + there) + cubic * bent
    return np.append(np.column_stack((here, between)).ravel(), signal[-2:])


def whitened(signal: Array) -> Array:
    """Return ``signal`` less what can be told of it from the samples before, of unit variance.

    Linear prediction of ``ORDER`` by the Yule-Walker equations. A signal that does not vary
    becomes zeros.
    """
    centred = signal - signal.mean()
    lags = [float(centred[: len(centred) - lag] @ centred[lag:]) for lag in range(ORDER + 1)]
    if not lags[0] > 0.0:
        return np.zeros(len(signal))
    apart = np.abs(np.subtract.outer(np.arange(ORDER), np.arange(ORDER)))
    normal = np.array(lags)[apart] + 0.001 * lags[0] * np.eye(ORDER)
    prediction = np.linalg.solve(normal, np.array(lags[1:]))
    white = np.convolve(centred, np.concatenate(([1.0], -prediction)))[: len(signal)]
    deviation = float(np.sqrt(np.mean(white * white)))
    return np.clip(white / deviation, -LARGEST_WHITE, LARGEST_WHITE)


def _goes_on(way_m: Array, time_s: Array) -> bool:
    """Whether the vehicle goes forward all the way, fast enough to be heard."""
    steps_m = np.diff(way_m)
    return bool(np.all(steps_m > 0.0)) and way_m[-1] - way_m[0] > -SLOWEST_M_S * float(time_s[0])
