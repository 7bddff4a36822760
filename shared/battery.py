"""What a machine's battery tells, as Linux shows it (``sysfs-class-power``)."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

from shared.messages import Supplies

POWER_SUPPLIES = Path("/sys/class/power_supply")


def read_battery(folder: Path) -> Supplies | None:
    """Return what the fullest battery under ``folder``, as Linux has it, tells; ``None`` if none.

    Batteries of a mouse or the like (scope ``Device``) are passed over.
    """
    found = [
        told
        for path in (sorted(folder.iterdir()) if folder.is_dir() else [])
        if read_text(path / "type") == "Battery"
        and read_text(path / "scope") != "Device"
        and (told := _read_one(path)) is not None
    ]
    return max(found, key=lambda each: each.battery or 0.0, default=None)


def _read_one(path: Path) -> Supplies | None:
    percent = _number(path / "capacity")
    if percent is None:
        for kind in ("energy", "charge"):
            now, full = _number(path / f"{kind}_now"), _number(path / f"{kind}_full")
            if now is not None and full:
                percent = 100.0 * now / full
    tenths_c = _number(path / "temp")
    if percent is None:
        return None
    return Supplies(
        battery=min(max(percent / 100.0, 0.0), 1.0),
        charging=read_text(path / "status") in ("Charging", "Full", "Not charging"),
        temperature_c=None if tenths_c is None else min(max(tenths_c / 10.0, -273.0), 1000.0),
    )


def read_text(path: Path) -> str:
    """Return what a driver tells in ``path``; nothing if it does not answer."""
    with suppress(OSError):
        return path.read_text(encoding="utf-8", errors="replace").strip()
    return ""


def _number(path: Path) -> float | None:
    try:
        return float(int(read_text(path)))
    except ValueError:
        return None
