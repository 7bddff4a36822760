"""The ``.npz`` sets of ``docs/data.md``: one recording a file, with its truth if there is one."""

from __future__ import annotations

import zipfile
import zlib
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from edge_agent.evaluation.truth import Truth, truth_of_path, truth_of_stances
from edge_agent.sources.recording import (
    MICROTESLA_PER_GAUSS,
    Array,
    Recording,
    SourceError,
)
from shared.units import NS_PER_S

_NEEDED = ("t_s", "acc_m_s2", "gyr_rad_s")
_NED_FROM_Z_UP = np.array([1.0, -1.0, -1.0])


class NpzSet(NamedTuple):
    """One file: its samples, and where the boot really was, if that is known."""

    recording: Recording
    truth: Truth | None


def read_npz_set(path: Path) -> NpzSet:
    """Return the recording at ``path``; raise ``SourceError`` if it is not a whole one."""
    arrays = _load(path)
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
        _shaped(path, arrays, "acc_m_s2", (count, 3)),
        _shaped(path, arrays, "gyr_rad_s", (count, 3)),
        None
        if field_gauss is None
        else MICROTESLA_PER_GAUSS * _shaped(path, arrays, "mag_gauss", (count, 3)),
        _shaped(path, arrays, "pressure_pa", (count,)) if "pressure_pa" in arrays else None,
    )
    return NpzSet(recording, _truth(path, arrays, time_s))


def _load(path: Path) -> dict[str, Array]:
    try:
        with path.open("rb") as file, zipfile.ZipFile(file) as archive:
            if (damaged := archive.testzip()) is not None:
                raise zipfile.BadZipFile(f"{damaged} is damaged")
            members = [name for name in archive.namelist() if name.endswith(".npy")]
            arrays = {name.removesuffix(".npy"): _array(archive, name) for name in members}
        return {
            name: array.astype(np.float64)
            for name, array in arrays.items()
            if array.dtype.kind in "fiu"
        }
    except FileNotFoundError:
        raise SourceError(f"{path}: no such file") from None
    # RuntimeError is what zipfile raises for flags it does not know.
    except (zipfile.BadZipFile, zlib.error, RuntimeError, ValueError, OSError, EOFError) as error:
        raise SourceError(f"{path}: not a whole .npz file ({error}); copy it again") from None


def _array(archive: zipfile.ZipFile, member: str) -> NDArray[Any]:
    with archive.open(member) as file:
        return np.lib.format.read_array(file, allow_pickle=False)


def _shaped(path: Path, arrays: dict[str, Array], name: str, shape: tuple[int, ...]) -> Array:
    array = arrays[name]
    if array.shape != shape:
        raise SourceError(
            f"{path}: {name} has shape {array.shape} where t_s asks for {shape}; export it again"
        )
    return array


def _truth(path: Path, arrays: dict[str, Array], time_s: Array) -> Truth | None:
    """Return the truth in whichever form the set has it; its axes are z up."""
    if "truth_stride_index" in arrays and "truth_stride_xy_m" in arrays:
        index = arrays["truth_stride_index"].astype(np.int64)
        position_m = _shaped(path, arrays, "truth_stride_xy_m", (len(index), 2))
        if len(index) < 2 or index.min() < 0 or index.max() >= len(time_s):
            raise SourceError(f"{path}: truth_stride_index points outside t_s; export it again")
        return truth_of_stances(time_s[index], position_m * _NED_FROM_Z_UP[:2])
    for times, positions in (("t_s", "truth_xyz_m"), ("truth_t_s", "truth_heel_xyz_m")):
        if times in arrays and positions in arrays:
            truth_s = arrays[times]
            position_m = _shaped(path, arrays, positions, (len(truth_s), 3))
            try:
                return truth_of_path(truth_s, position_m * _NED_FROM_Z_UP)
            except ValueError as error:
                raise SourceError(f"{path}: {positions}: {error}; export it again") from None
    return None
