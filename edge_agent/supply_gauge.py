"""What a node has left, as its machine tells: Linux's power supplies, and a file of others' words.

The file is JSON with the fields of ``shared.messages.Supplies``; whatever reads a cylinder's
pressure, or the battery of a sensor, writes it anew at least once a minute.
"""

from __future__ import annotations

import time
from pathlib import Path

import msgspec
import structlog

from shared.battery import POWER_SUPPLIES, read_battery
from shared.messages import Supplies
from shared.units import NS_PER_S

LOOK_PERIOD_S = 5.0
STALE_S = 60.0
"""What a file says counts for so long after it was written."""

MOST_BYTES = 4096

_log = structlog.stdlib.get_logger(__name__)


class SupplyGauge:
    """Reads what is left, now and then: called as often as one likes, by one thread."""

    def __init__(self, told: Path | None = None, power: Path = POWER_SUPPLIES) -> None:
        """``told``: a file that others write; what it says counts more than ``power``'s."""
        self._told = told
        self._power = power
        self._due_s = 0.0
        self._mtime_ns: int | None = None
        self._written_s = 0.0
        self._known: Supplies | None = None
        self._complaint = ""

    def __call__(self) -> Supplies | None:
        """Return what is left; ``None`` if nothing tells."""
        now_s = time.monotonic()
        if now_s >= self._due_s:
            self._due_s = now_s + LOOK_PERIOD_S
            told, battery = self._read_told(), read_battery(self._power)
            self._known = told if battery is None else _joined(battery, told)
        return self._known

    def _read_told(self) -> Supplies | None:
        if self._told is None:
            return None
        try:
            age_s = self._age_s(self._told.stat().st_mtime_ns)
            with self._told.open("rb") as stream:
                told = msgspec.json.decode(stream.read(MOST_BYTES), type=Supplies)
        except (OSError, msgspec.MsgspecError, UnicodeDecodeError) as error:
            self._complain(str(error))
            return None
        self._complain(f"not written for {age_s:.0f} s" if age_s > STALE_S else "")
        return told if age_s <= STALE_S else None

    def _age_s(self, mtime_ns: int) -> float:
        """Return how long ago the file was written: of what is written anew no clock tells."""
        now_s = time.monotonic()
        if mtime_ns != self._mtime_ns:
            is_new = self._mtime_ns is not None
            self._written_s = now_s - (0.0 if is_new else time.time() - mtime_ns / NS_PER_S)
            self._mtime_ns = mtime_ns
        return now_s - self._written_s

    def _complain(self, why: str) -> None:
        kind = why[:20]
        if why and kind != self._complaint:
            _log.warning("what is left cannot be read", path=str(self._told), why=why)
        self._complaint = kind


def _joined(battery: Supplies, told: Supplies | None) -> Supplies:
    """Return what both say; of the battery, what was told by others counts."""
    if told is None:
        return battery
    if told.battery is None:
        told = msgspec.structs.replace(told, battery=battery.battery, charging=battery.charging)
    if told.temperature_c is None:
        told = msgspec.structs.replace(told, temperature_c=battery.temperature_c)
    return told
