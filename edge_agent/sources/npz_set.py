"""The ``.npz`` sets of ``docs/data.md``: one recording a file, with its truth if there is one."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from edge_agent.evaluation.truth import Truth, truth_of_path, truth_of_stances
from edge_agent.sources.recording import (
    MICROTESLA_PER_GAUSS,
    Array,
    Recording,
    SourceError,
)
from shared.npz_file import NpzFileError, array_of, load_npz
from shared.units import NS_PER_S

_NEEDED = ("t_s", "acc_m_s2", "gyr_rad_s")
_NED_FROM_Z_UP = np.array([1.0, -1.0, -1.0])


class NpzSet(NamedTuple):
    """One file: its samples, and where the boot really was, if that is known."""

    recording: Recording
    truth: Truth | None


def read_npz_set(path: Path) -> NpzSet:
    """Return the recording at ``path``; raise ``SourceError`` if it is not a whole one."""
    try:
        return _read(path)
    except NpzFileError as error:
        raise SourceError(str(error)) from error


def _read(path: Path) -> NpzSet:
    arrays = load_npz(path)
    missing = [name for name in _NEEDED if name not in arrays]
    if missing:
        raise SourceError(
            f"{path}: no array {', '.join(missing)}; it has {', '.join(sorted(arrays)) or 'none'}. "
            f"A boot recording needs {', '.join(_NEEDED)} "
        )
    time_s = arrays["t_s"]
    count = len(time_s) if time_s.ndim == 1 else 0
    if count < 2:
        raise SourceError(f"{path}: t_s has shape {time_s.shape}; two samples or more are needed")
    if not np.isfinite(time_s).all() or np.abs(time_s).max() > 1e9:
        raise SourceError(f"{path}: t_s holds times that are no seconds; export it again")
    field_gauss = arrays.get("mag_gauss")
    recording = Recording(
        np.round(time_s * NS_PER_S).astype(np.int64),
        array_of(path, arrays, "acc_m_s2", (count, 3)),
        array_of(path, arrays, "gyr_rad_s", (count, 3)),
        None
        if field_gauss is None
        else MICROTESLA_PER_GAUSS * array_of(path, arrays, "mag_gauss", (count, 3)),
        array_of(path, arrays, "pressure_pa", (count,)) if "pressure_pa" in arrays else None,
    )
    return NpzSet(recording, _truth(path, arrays, time_s))


def _truth(path: Path, arrays: dict[str, Array], time_s: Array) -> Truth | None:
    """Return the truth in whichever form the set has it; its axes are z up."""
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
