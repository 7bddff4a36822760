"""One decorator for the numerical kernels, typed, so that the rest of the house stays strict."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any, TypeVar, cast

from numba import njit
from numba.core.dispatcher import Dispatcher

Kernel = TypeVar("Kernel", bound=Callable[..., object])


def compiled(function: Kernel) -> Kernel:
    """Compile ``function`` with numba at its first call; ``.py_func`` is its plain-Python meaning.

    Other threads run meanwhile. Machine code is kept on disk: beside the source, or in the user's
    cache folder where that cannot be written (``NUMBA_CACHE_DIR`` names another). Where there is no
    such folder either, it is compiled in every process.
    """
    try:
        dispatcher: Dispatcher = njit(cache=True, error_model="numpy", nogil=True)(function)
    except RuntimeError:
        return cast(Kernel, njit(error_model="numpy", nogil=True)(function))
    _drop_stale(dispatcher, function)
    return cast(Kernel, dispatcher)


def direct(kernel: Kernel) -> Kernel:
    """Return the machine code of a kernel that has been compiled for one set of types, itself.

    Called so, a kernel does not look up its arguments' types, which for records costs more than
    what many a kernel does. Arrays must be of those types; numbers are cast. Raises ValueError for
    a kernel compiled for no set of types, or for several.
    """
    (machine_code,) = cast(Dispatcher, kernel).overloads.values()
    return cast(Kernel, cast(Any, machine_code).entry_point)


def is_kept(kernel: Callable[..., object]) -> bool:
    """Whether there is machine code of ``kernel`` on disk, so that calling it is no long wait."""
    return bool(_indexes(cast(Dispatcher, kernel)))


def _drop_stale(dispatcher: Dispatcher, function: Callable[..., object]) -> None:
    """Forget machine code older than any source in the kernel's folder.

    A kernel is stored with those it calls, but numba looks for changes only in its own file.
    """
    changed_ns = _sources_changed_ns(Path(inspect.getfile(function)).parent)
    for index in _indexes(dispatcher):
        # Another process that begins now may have forgotten it before.
        with suppress(FileNotFoundError):
            if index.stat().st_mtime_ns < changed_ns:
                index.unlink()


def _indexes(dispatcher: Dispatcher) -> list[Path]:
    """Return the files that list what machine code of a kernel is kept on disk."""
    folder = dispatcher.stats.cache_path
    if folder is None:
        return []
    return list(Path(folder).glob(f"*.{dispatcher.py_func.__qualname__}-*.nbi"))


@cache
def _sources_changed_ns(folder: Path) -> int:
    """Return when the newest source in ``folder`` was written."""
    return max(source.stat().st_mtime_ns for source in folder.glob("*.py"))
