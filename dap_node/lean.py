"""Keeps a DAP's process small; to be imported before what logs.

``structlog`` loads ``rich`` where it can be imported, to colour tracebacks, and with ``asyncio``
the system's ``ssl``: 6 MB that a box without a terminal has no use for. Whoever needs either of
them later imports it all the same.
"""

from __future__ import annotations

import sys
from types import ModuleType

if "structlog" not in sys.modules:
    known: dict[str, ModuleType | None] = sys.modules  # type: ignore[assignment]
    spared = [name for name in ("rich", "ssl") if name not in known]
    for name in spared:
        # This is how the import system is told that there is no such module.
        known[name] = None
    import structlog  # noqa: F401

    for name in spared:
        del known[name]
