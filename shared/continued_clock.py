"""A clock that one process hands on to the next: what is gone on with keeps its time line."""

from __future__ import annotations

from pathlib import Path

import msgspec
import structlog

from shared.clock import SystemClock
from shared.clock_spans import boot_id
from shared.files import replace_atomically

_log = structlog.stdlib.get_logger(__name__)


class ClockBase(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What a process's clock read when the machine was started, in its start ``boot``."""

    boot: str
    base_ns: int


def continued_clock(path: Path, *, goes_on: bool) -> SystemClock:
    """Return the clock to go by, and note it in the file at ``path``.

    Who ``goes_on`` with what another process began goes by that one's clock, however the machine's
    was set meanwhile; where the machine itself was started anew, by the machine's clock.
    """
    boot = boot_id()
    before = _read(path) if goes_on else None
    same_start = before is not None and before.boot == boot != ""
    clock = SystemClock(before.base_ns) if before is not None and same_start else SystemClock()
    try:
        with replace_atomically(path) as file:
            file.write(msgspec.json.encode(ClockBase(boot, clock.base_ns)))
    except OSError as error:
        _log.warning("the clock is not noted for who goes on", why=str(error))
    return clock


def _read(path: Path) -> ClockBase | None:
    try:
        return msgspec.json.decode(path.read_bytes(), type=ClockBase)
    except FileNotFoundError:
        return None
    except (OSError, msgspec.MsgspecError, UnicodeDecodeError) as error:
        _log.warning("the clock to go on with is not known", file=str(path), why=str(error))
        return None
