"""How the tracking of a boot begins: the true rate, a moment to level on, and which way is up."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from edge_agent.inertial.boot_state import State, initial_state
from edge_agent.inertial.eskf_parameters import HIGHEST_RATE_HZ, EskfParameters, windows_at
from edge_agent.inertial.sample_clock import ClockState, start_clock
from shared.maths.rotations import Vector3
from shared.messages import ImuSample
from shared.units import NS_PER_S

START_UP_S = 0.6
"""So many seconds of samples are looked at before the first is taken."""

STILL_S = 0.2


class Start(NamedTuple):
    """All that a tracker needs to begin.

    ``samples`` go on from the stillest moment, ``clock`` stands at the first of them. ``block`` is
    how many raw samples are averaged into one, of a sensor faster than the filter.
    """

    state: State
    clock: ClockState
    rate_hz: float
    block: int
    samples: list[ImuSample]


def start_on(waiting: Sequence[ImuSample], parameters: EskfParameters) -> Start | str:
    """Return how to begin on the samples waiting, or why one cannot, in words."""
    raw = sorted(waiting, key=lambda sample: sample.time_ns)
    try:
        raw_rate_hz = NS_PER_S / start_clock([sample.time_ns for sample in raw]).period_ns
        block = max(1, int(np.ceil(raw_rate_hz / HIGHEST_RATE_HZ)))
        rate_hz = raw_rate_hz / block
        windows_at(parameters, rate_hz)
        samples = [mean_sample(raw[i : i + block]) for i in range(0, len(raw) - block + 1, block)]
        force_m_s2 = np.array([sample.force_m_s2 for sample in samples])
        rate_rad_s = np.array([sample.rate_rad_s for sample in samples])
        first, count = stillest(force_m_s2, rate_rad_s, round(STILL_S * rate_hz))
        window = slice(first, first + count)
        state = initial_state(parameters, force_m_s2[window], rate_rad_s[window])
        clock = start_clock([sample.time_ns for sample in samples[first:]])
    except ValueError as error:
        return str(error)
    return Start(state, clock, rate_hz, block, samples[first:])


def stillest(
    force_m_s2: NDArray[np.float64], rate_rad_s: NDArray[np.float64], count: int
) -> tuple[int, int]:
    """Return (first, count) of the window of samples that varies and turns least."""
    count = min(count, len(force_m_s2))
    force = sliding_window_view(force_m_s2, count, axis=0)
    rate = sliding_window_view(rate_rad_s**2, count, axis=0)
    cost = force.var(axis=2).sum(axis=1) + rate.mean(axis=(1, 2))
    return int(np.argmin(cost)), count


def mean_sample(samples: Sequence[ImuSample]) -> ImuSample:
    """Return the mean of one sample or more, of its time as well, without the field."""
    if len(samples) == 1:
        return samples[0]
    first_ns = samples[0].time_ns
    since_ns = sum(sample.time_ns - first_ns for sample in samples)
    return ImuSample(
        first_ns + since_ns // len(samples),
        _mean([sample.force_m_s2 for sample in samples]),
        _mean([sample.rate_rad_s for sample in samples]),
    )


def _mean(vectors: list[Vector3]) -> Vector3:
    x, y, z = (sum(axis) / len(vectors) for axis in zip(*vectors, strict=True))
    return (x, y, z)
