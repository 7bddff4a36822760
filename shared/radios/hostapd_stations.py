"""What hostapd answers of its stations, taken apart (pure).

``STA-FIRST``, ``STA-NEXT ADDRESS`` and ``STA ADDRESS`` are answered with the station's address on
a line and a ``name=value`` on each other; with nothing where there is no further one, and with
``FAIL`` where there is none.
"""

from __future__ import annotations

from contextlib import suppress

from shared.radios.station_counters import Polled, known_dbm
from shared.stations import parse_address

COUNTED = ("rx_packets", "rx_bytes")


def polled_station(answer: str) -> Polled | None:
    """Return what one answer tells; ``None`` if it is of no station.

    The signal is there where hostapd drives the radio by nl80211.
    """
    first, *rest = answer.splitlines() or [""]
    try:
        address = parse_address(first)
    except ValueError:
        return None
    told = {name: value for name, _, value in (line.partition("=") for line in rest)}
    return Polled(
        address,
        tuple(count for name in COUNTED if (count := _whole(told.get(name))) is not None),
        known_dbm(_whole(told.get("signal"))),
        inactive_ms=_whole(told.get("inactive_msec")) or 0,
    )


def _whole(text: str | None) -> int | None:
    if text is not None:
        with suppress(ValueError):
            return int(text)
    return None
