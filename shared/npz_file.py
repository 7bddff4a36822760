"""NumPy's ``.npz`` files, read with no trust in what they hold."""

from __future__ import annotations

import zipfile
import zlib
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

Array: TypeAlias = NDArray[np.float64]


class NpzFileError(ValueError):
    """A file cannot be used. The text names it, what is wrong, and what to do."""


def load_npz(path: Path) -> dict[str, Array]:
    """Return the numeric arrays in the file by name; raise ``NpzFileError`` if it is damaged."""
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
        raise NpzFileError(f"{path}: no such file") from None
    # RuntimeError is what zipfile raises for flags it does not know.
    except (zipfile.BadZipFile, zlib.error, RuntimeError, ValueError, OSError, EOFError) as error:
        raise NpzFileError(f"{path}: not a whole .npz file ({error}); copy it again") from None


def array_names(path: Path) -> frozenset[str]:
    """Return the names of the arrays in the file, none if it is damaged or not there."""
    try:
        with zipfile.ZipFile(path) as archive:
            members = archive.namelist()
    except (zipfile.BadZipFile, OSError):
        return frozenset()
    return frozenset(name.removesuffix(".npy") for name in members if name.endswith(".npy"))


def array_of(path: Path, arrays: dict[str, Array], name: str, shape: tuple[int, ...]) -> Array:
    """Return the array ``name`` of ``path``; raise ``NpzFileError`` if it is not of ``shape``."""
    array = arrays[name]
    if array.shape != shape:
        raise NpzFileError(
            f"{path}: {name} has shape {array.shape} where the others ask for {shape}; "
            "export it again"
        )
    return array


def _array(archive: zipfile.ZipFile, member: str) -> NDArray[Any]:
    with archive.open(member) as file:
        return np.lib.format.read_array(file, allow_pickle=False)
