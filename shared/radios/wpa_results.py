"""What wpa_supplicant answers of the access points it hears, taken apart (pure).

``STATUS`` and ``SIGNAL_POLL`` are answered with a ``name=value`` on each line, ``SCAN_RESULTS``
with a header and, on each line, parted by tabs: BSSID, frequency, signal, flags, SSID.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress

from shared.messages import StationAddress
from shared.radios.station_counters import known_dbm
from shared.stations import parse_address


def linked_to(status: str, signal: str) -> tuple[StationAddress, float] | None:
    """Return the access point that the unit is linked to, and its signal (dBm); ``None`` if none.

    ``status`` and ``signal`` are the answers to ``STATUS`` and ``SIGNAL_POLL``.
    """
    told = dict(line.split("=", 1) for line in (status + "\n" + signal).splitlines() if "=" in line)
    if told.get("wpa_state") != "COMPLETED":
        return None
    return _reading(told.get("bssid", ""), told.get("RSSI", ""))


def scanned(results: str) -> Iterator[tuple[StationAddress, float]]:
    """Yield each access point that a scan found, and its signal (dBm)."""
    for line in results.splitlines():
        cells = line.split("\t")
        reading = _reading(cells[0], cells[2]) if len(cells) > 2 else None
        if reading is not None:
            yield reading


def _reading(bssid: str, signal: str) -> tuple[StationAddress, float] | None:
    with suppress(ValueError):
        dbm = known_dbm(float(signal))
        return None if dbm is None else (parse_address(bssid), dbm)
    return None
