"""The ``.npz`` sets of ``docs/data.md``: one recording a file, with its truth if there is one."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import structlog
from numpy.typing import NDArray

from edge_agent.evaluation.course_truth import DrivenSpeed, MountTruth, StepCount, Waypoints
from edge_agent.evaluation.measured_path import truth_of_path
from edge_agent.evaluation.truth import Truth, truth_of_stances
from edge_agent.sources.recording import (
    LARGEST_TIME_S,
    MICROTESLA_PER_GAUSS,
    Array,
    Recording,
    SourceError,
    at_times,
    refuse_no_pace,
    refuse_other_units,
)
from edge_agent.sources.time_stamps import repaired
from shared.npz_file import NpzFileError, array_of, load_npz
from shared.units import NS_PER_S

WAIST_COURSE_M = 20.0
"""Of the sets that tell each foot's flights: 10 m out, and back."""

FLIGHT_RATE_HZ = 100.0
"""They are told by samples of this rate since the first, lost ones counted."""

SENSORS = ("acc_m_s2", "gyr_rad_s")

BURSTS_SHARE = 0.05
"""Of samples with the stamp of the one before: so many come in bursts, fewer are passed over."""

BESIDE_S = 2.0
"""A way-point so long before the first sample, or after the last, is still of the recording."""

_NED_FROM_Z_UP = np.array([1.0, -1.0, -1.0])

_log = structlog.stdlib.get_logger(__name__)


class NpzSet(NamedTuple):
    """One file: its samples, and what is known of the way, if anything is."""

    recording: Recording
    truth: MountTruth | None


def read_npz_set(path: Path, *, needs_gyro: bool = True) -> NpzSet:
    """Return the recording at ``path``; raise ``SourceError`` if it is not a whole one.

    Sensors on time stamps of their own are interpolated at the accelerometer's. Without a
    gyroscope, which ``needs_gyro`` refuses, rates are NaN.
    """
    try:
        return _read(path, needs_gyro=needs_gyro)
    except NpzFileError as error:
        raise SourceError(str(error)) from error


def _read(path: Path, *, needs_gyro: bool) -> NpzSet:
    arrays = load_npz(path)
    clock = "t_s" if "t_s" in arrays or "t_acc_s" not in arrays else "t_acc_s"
    needed = (clock, "acc_m_s2", *(["gyr_rad_s"] * needs_gyro))
    missing = [name for name in needed if name not in arrays]
    if missing:
        raise SourceError(
            f"{path}: no array {', '.join(missing)}; it has {', '.join(sorted(arrays)) or 'none'}. "
            f"A recording needs {', '.join(needed)}"
        )
    time_s = arrays[clock]
    count = len(time_s) if time_s.ndim == 1 else 0
    if count < 2:
        raise SourceError(f"{path}: {clock} has shape {time_s.shape}; two samples or more needed")
    _refuse_no_times(path, clock, time_s)
    refuse_no_pace(path, clock, time_s)
    rate_rad_s = _at(path, arrays, ("t_gyr_s", "gyr_rad_s"), time_s)
    field_gauss = _at(path, arrays, ("t_mag_s", "mag_gauss"), time_s)
    force_m_s2 = array_of(path, arrays, "acc_m_s2", (count, 3))
    refuse_other_units(path, force_m_s2, rate_rad_s, SENSORS)
    recording = Recording(
        np.round(time_s * NS_PER_S).astype(np.int64),
        force_m_s2,
        np.full((count, 3), np.nan) if rate_rad_s is None else rate_rad_s,
        _at(path, arrays, ("t_mag_s", "mag_uT"), time_s)
        if field_gauss is None
        else MICROTESLA_PER_GAUSS * field_gauss,
        array_of(path, arrays, "pressure_pa", (count,)) if "pressure_pa" in arrays else None,
    )
    return NpzSet(_stamped(recording), _truth(path, arrays, time_s))


def _stamped(recording: Recording) -> Recording:
    """Return the recording on times that rise, where stamps were those of bursts."""
    if np.mean(np.diff(recording.time_ns) == 0) < BURSTS_SHARE:
        return recording
    first_ns = recording.time_ns[0]
    since_s = (recording.time_ns - first_ns) / NS_PER_S
    mended = repaired(since_s, np.hstack((recording.force_m_s2, recording.rate_rad_s)))
    time_ns = first_ns + np.round(mended.time_s * NS_PER_S).astype(np.int64)
    return replace(recording.rows(mended.rows), time_ns=time_ns)


def _refuse_no_times(path: Path, name: str, time_s: Array) -> None:
    if not np.isfinite(time_s).all() or np.abs(time_s).max(initial=0.0) > LARGEST_TIME_S:
        raise SourceError(f"{path}: {name} holds times that are no seconds; export it again")


def _at(
    path: Path, arrays: dict[str, Array], names: tuple[str, str], time_s: Array
) -> Array | None:
    """Return a sensor's readings (n, 3) at ``time_s`` (n,); ``None`` if the file has none.

    ``names`` are those of its own time stamps, which it may share with the accelerometer, and of
    its readings.
    """
    clock, name = names
    if name not in arrays:
        return None
    if clock not in arrays:
        return array_of(path, arrays, name, (len(time_s), 3))
    own_s = _rising(path, arrays, clock)
    readings = array_of(path, arrays, name, (len(own_s), 3))
    return at_times(time_s, own_s, readings)


def _rising(path: Path, arrays: dict[str, Array], name: str) -> Array:
    """Return the times ``name`` (k,) in seconds, which must not fall."""
    time_s = arrays[name]
    if time_s.ndim != 1 or not time_s.size:
        raise SourceError(f"{path}: {name} has shape {time_s.shape}; a row of times is needed")
    _refuse_no_times(path, name, time_s)
    if np.any(np.diff(time_s) < 0.0):
        raise SourceError(f"{path}: {name} goes back; put the rows in order")
    return time_s


def _truth(path: Path, arrays: dict[str, Array], time_s: Array) -> MountTruth | None:
    """Return the truth in whichever form the set has it; its axes are z up."""
    return _stances(path, arrays, time_s) or _course(path, arrays, time_s)


def _course(path: Path, arrays: dict[str, Array], time_s: Array) -> MountTruth | None:
    """Return the truth of a walk or a drive of which no stance is known."""
    if "truth_waypoint_t_xy" in arrays:
        rows = arrays["truth_waypoint_t_xy"]
        array_of(path, arrays, "truth_waypoint_t_xy", (len(rows), 3))
        if not (np.isfinite(rows).all() and np.all(np.diff(rows[:, 0]) > 0.0)):
            raise SourceError(f"{path}: truth_waypoint_t_xy: no rising times and places in it")
        rows = _walked(path, rows, time_s)
        return Waypoints(rows[:, 0], rows[:, 1:] * _NED_FROM_Z_UP[:2])
    if "truth_steps" in arrays:
        return StepCount(time_s, array_of(path, arrays, "truth_steps", (len(time_s),)))
    if "truth_left_steps" in arrays and "truth_right_steps" in arrays:
        ends_s = time_s[0] + _flight_ends(path, arrays, time_s) / FLIGHT_RATE_HZ
        counted_s = np.concatenate((time_s[:1], ends_s))
        return StepCount(counted_s, np.arange(0.0, len(counted_s)), WAIST_COURSE_M)
    if "truth_speed_m_s" in arrays and "truth_t_s" in arrays:
        truth_s = _rising(path, arrays, "truth_t_s")
        speed_m_s = array_of(path, arrays, "truth_speed_m_s", truth_s.shape)
        told = np.isfinite(speed_m_s)
        if not told.any():
            raise SourceError(f"{path}: truth_speed_m_s holds no speed; export it again")
        return DrivenSpeed(truth_s[told], speed_m_s[told])
    return None


def _walked(path: Path, rows: Array, time_s: Array) -> Array:
    """Return the way-points (k, 3) that were passed while there were samples."""
    first_s, last_s = time_s.min() - BESIDE_S, time_s.max() + BESIDE_S
    walked: Array = rows[(rows[:, 0] >= first_s) & (rows[:, 0] <= last_s)]
    if len(rows) and not len(walked):
        raise SourceError(f"{path}: truth_waypoint_t_xy is of another time than the samples")
    if len(walked) < len(rows):
        reason = f"no samples at {len(rows) - len(walked)} of {len(rows)} way-points"
        _log.warning(f"{path}: scored as far as it was recorded", reason=reason)
    return walked


def _flight_ends(path: Path, arrays: dict[str, Array], time_s: Array) -> NDArray[np.int64]:
    """Return the samples (k,) at which a foot of either side lands, in order."""
    ends = [flights_of(path, arrays, side, time_s)[:, 1] for side in ("left", "right")]
    return np.sort(np.concatenate(ends))


def flights_of(path: Path, arrays: dict[str, Array], side: str, time_s: Array) -> NDArray[np.int64]:
    """Return the first and the last sample of each flight (k, 2) of a foot, lost ones counted.

    ``time_s`` (n,) is when the samples of the recording were taken. Raises ``SourceError``.
    """
    name = f"truth_{side}_steps"
    flights = array_of(path, arrays, name, (len(arrays.get(name, ())), 2))
    count = FLIGHT_RATE_HZ * (time_s[-1] - time_s[0]) + 1.0
    if not ((flights == np.rint(flights)) & (flights >= 0) & (flights < count)).all():
        raise SourceError(f"{path}: {name} holds what is no sample of it; export it again")
    return flights.astype(np.int64)


def _stances(path: Path, arrays: dict[str, Array], time_s: Array) -> Truth | None:
    """Return the truth of a boot, if the set is of one."""
    if "truth_stride_index" in arrays and "truth_stride_xy_m" in arrays:
        index = _stance_index(path, arrays["truth_stride_index"], len(time_s))
        position_m = array_of(path, arrays, "truth_stride_xy_m", (len(index), 2))
        if not np.isfinite(position_m).all():
            raise SourceError(f"{path}: truth_stride_xy_m: not all finite; export it again")
        return truth_of_stances(time_s[index], position_m * _NED_FROM_Z_UP[:2])
    for times, positions in (("t_s", "truth_xyz_m"), ("truth_t_s", "truth_heel_xyz_m")):
        if times in arrays and positions in arrays:
            truth_s = array_of(path, arrays, times, arrays[times].shape[:1] or (0,))
            position_m = array_of(path, arrays, positions, (len(truth_s), 3))
            try:
                return truth_of_path(truth_s, position_m * _NED_FROM_Z_UP)
            except ValueError as error:
                raise SourceError(f"{path}: {positions}: {error}; export it again") from None
    return None


def _stance_index(path: Path, index: Array, count: int) -> NDArray[np.int64]:
    """Return the samples (k,) of the true stances, out of ``count``."""
    wrong = None
    if index.ndim != 1 or len(index) < 2:
        wrong = f"has shape {index.shape}, where a row of two stances or more is needed"
    elif not (np.isfinite(index).all() and (index == np.rint(index)).all()):
        wrong = "holds what is no whole number"
    elif index.min() < 0 or index.max() >= count:
        wrong = "points outside t_s"
    elif not (np.diff(index) > 0).all():
        wrong = "does not rise from stance to stance"
    if wrong is not None:
        raise SourceError(f"{path}: truth_stride_index {wrong}; export it again")
    return index.astype(np.int64)
