"""How good a vehicle's way is: speed against the car's own, acceleration against a fixed phone's.

Speed (``speed_rmse_m_s``): the way told over each second against the mean of the car's speed over
it, from the first sample to the last, no satellite fix after the first moment, whose true speed
is told. ``speed_live_rmse_m_s`` is that of the speed of the moment, sample by sample, which knows
nothing of what comes after it.

Acceleration: forward, free of gravity, every sample, not low-passed, from ``SETTLING_S`` after the
end of each slip until the next begins. It is held against what the same method tells of the same
drive from the phone as it was fixed to the car; the paper holds it against a second phone. Its
correlation is Pearson's of the same samples.

Re-alignment (``realignment_s``): from the end of a slip, when the phone lies still again, to the
first moment from which all three axes of acceleration are within ``ALIGNED_M_S2`` of the fixed
phone's (root mean square over ``ALIGNED_FOR_S``; 3° of tilt). The longest of a trial is told; a
slip after which that never comes counts until the next.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple, Protocol

import msgspec
import numpy as np

from edge_agent.evaluation.course_truth import DrivenSpeed, MountedDrive
from edge_agent.evaluation.score_card import TrialScore, failed_trial
from edge_agent.evaluation.truth import Array
from edge_agent.mounts.interface import Increment, Mount, TakesSpeed
from edge_agent.sources.recording import Recording
from shared.maths.rotations import Vector3
from shared.units import NS_PER_S

SECOND_S = 1.0
SETTLING_S = 0.2
ALIGNED_M_S2 = 0.5
ALIGNED_FOR_S = 0.5
STEP_S = 0.02

FIRST_SPEED_SD_M_S = 0.1
"""How well the speed is known of the first moment."""


class VehicleMountLike(Mount, TakesSpeed, Protocol):
    """A vehicle's mount, which tells more than the way."""

    acceleration_m_s2: Vector3 | None

    @property
    def speed_m_s(self) -> float:
        """The speed of the moment."""


class Drive(NamedTuple):
    """What a mount told: increments, and by sample acceleration (n, 3) and speed (n,).

    Acceleration is forward, right and down; NaN before the mount knows which way is forward.
    """

    increments: list[Increment]
    acceleration_m_s2: Array
    speed_m_s: Array


def follow_drive(mount: VehicleMountLike, samples: Recording, speed: DrivenSpeed) -> Drive:
    """Return what a new ``mount`` makes of ``samples``, given the first of the true ``speed``."""
    first_s = int(samples.time_ns[0]) / NS_PER_S
    first_m_s = float(np.interp(first_s, speed.time_s, speed.speed_m_s))
    mount.know_speed(first_m_s, FIRST_SPEED_SD_M_S)
    increments: list[Increment] = []
    acceleration_m_s2 = np.full((len(samples), 3), np.nan)
    speed_m_s = np.empty(len(samples))
    for row, sample in enumerate(samples):
        told = mount.step(sample)
        if told is not None:
            increments.append(told)
        if mount.acceleration_m_s2 is not None:
            acceleration_m_s2[row] = mount.acceleration_m_s2
        speed_m_s[row] = mount.speed_m_s
    return Drive(increments + mount.finish(), acceleration_m_s2, speed_m_s)


def score_drive(
    name: str, group: str, drive: Drive, fixed: Drive | None, truth: MountedDrive
) -> TrialScore:
    """Return the score of ``drive``; of its acceleration against ``fixed``, if there were slips.

    A drive of no whole second, or that no increment was told of, has none.
    """
    time_s = truth.fixed.samples.time_ns / NS_PER_S
    if not drive.increments or time_s[-1] - time_s[0] <= SECOND_S:
        failure = (
            f"nothing told of {time_s[-1] - time_s[0]:.1f} s: it takes two seconds of driving, "
            "forces with gravity in them (m/s²) and rates"
        )
        return failed_trial(name, group, truth, failure)
    speed = truth.fixed.speed
    told_m, true_m = _way_by_second(drive.increments, time_s, speed)
    true_m_s = np.interp(time_s, speed.time_s, speed.speed_m_s)
    length_m = float(true_m.sum())
    row = TrialScore(
        name=name,
        set=group,
        length_m=length_m,
        mean_speed_m_s=float(true_m_s.mean()),
        distance_error_pct=100.0 * (float(told_m.sum()) / length_m - 1.0) if length_m else None,
        speed_rmse_m_s=_rms((told_m - true_m) / SECOND_S),
        speed_live_rmse_m_s=_rms(drive.speed_m_s - true_m_s),
    )
    if fixed is None or not truth.slips:
        return row
    return _with_slips(row, drive, fixed, truth)


def _with_slips(row: TrialScore, drive: Drive, fixed: Drive, truth: MountedDrive) -> TrialScore:
    time_s = truth.fixed.samples.time_ns / NS_PER_S
    off_m_s2 = drive.acceleration_m_s2 - fixed.acceleration_m_s2
    ends_s = [*(slip.begin_s for slip in truth.slips[1:]), float(time_s[-1])]
    settled = np.zeros(len(time_s), dtype=np.bool_)
    delays_s = []
    for slip, end_s in zip(truth.slips, ends_s, strict=True):
        settled |= (time_s > slip.end_s + SETTLING_S) & (time_s < end_s)
        delays_s.append(_realignment_s(time_s, off_m_s2, slip.end_s, end_s))
    settled &= np.isfinite(off_m_s2[:, 0])
    forward = [one.acceleration_m_s2[settled, 0] for one in (drive, fixed)]
    return _replace(
        row,
        slips=len(truth.slips),
        realignment_s=max(delays_s),
        acceleration_rmse_m_s2=_rms(off_m_s2[settled, 0]),
        acceleration_correlation=float(np.corrcoef(*forward)[0, 1]),
    )


def _replace(row: TrialScore, **changes: float | None) -> TrialScore:
    finite = {
        name: value if value is not None and math.isfinite(value) else None
        for name, value in changes.items()
    }
    return msgspec.structs.replace(row, **finite)


def _realignment_s(time_s: Array, off_m_s2: Array, begin_s: float, end_s: float) -> float:
    squared = np.sum(np.nan_to_num(off_m_s2, nan=np.inf) ** 2, axis=1)
    for at_s in np.arange(begin_s, end_s - ALIGNED_FOR_S, STEP_S):
        rows = (time_s >= at_s) & (time_s < at_s + ALIGNED_FOR_S)
        if rows.any() and squared[rows].mean() <= ALIGNED_M_S2**2:
            return float(at_s) - begin_s
    return end_s - begin_s


def _way_by_second(
    increments: Sequence[Increment], time_s: Array, speed: DrivenSpeed
) -> tuple[Array, Array]:
    """Return the way (m) told over each whole second (k,), and the true one."""
    seconds_s = np.arange(time_s[0], time_s[-1], SECOND_S)
    ends_s = [float(time_s[0])]
    ways_m = [0.0]
    for one in increments:
        # Between increments the vehicle stands.
        ends_s += [one.start_time_ns / NS_PER_S, one.end_time_ns / NS_PER_S]
        ways_m += [ways_m[-1], ways_m[-1] + math.hypot(*one.displacement_m)]
    steps_m = 0.5 * (speed.speed_m_s[1:] + speed.speed_m_s[:-1]) * np.diff(speed.time_s)
    true_m = np.concatenate(([0.0], np.cumsum(steps_m)))
    return (
        np.diff(np.interp(seconds_s, ends_s, ways_m)),
        np.diff(np.interp(seconds_s, speed.time_s, true_m)),
    )


def _rms(errors: Array) -> float:
    return float(np.sqrt(np.mean(np.square(errors))))
