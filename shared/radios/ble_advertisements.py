"""What a Bluetooth advertisement calls its sender (pure).

A sender may be listed by its address, by what it says it is as a beacon (UUID/major/minor, in the
manufacturer's data), or by the UUID of a service of its own. Which of them, the table knows.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from contextlib import suppress
from uuid import UUID

from shared.messages import StationAddress
from shared.radios.readings import Reading
from shared.stations import parse_address

APPLE = 0x004C
"""The company under whose number beacons put their UUID, whoever made them."""

_BEACON = b"\x02\x15"
_BEACON_BYTES = 23
_STANDARD = "-0000-1000-8000-00805f9b34fb"
"""How UUIDs of standard services end, which say what a device is, not which."""


def reading_of(
    address: str,
    rssi_dbm: float,
    manufacturer_data: Mapping[int, bytes],
    service_uuids: Iterable[str],
) -> Reading | None:
    """Return the reading of an advertisement; ``None`` if nothing in it names its sender."""
    names = [name for text in (address, *service_uuids) if (name := _name(text)) is not None]
    beacon = _beacon(manufacturer_data.get(APPLE, b""))
    if beacon is not None:
        names.append(beacon)
    return Reading(names[0], rssi_dbm, aliases=tuple(names[1:])) if names else None


def _name(text: str) -> StationAddress | None:
    with suppress(ValueError):
        name = parse_address(text)
        return None if name.endswith(_STANDARD) else name
    return None


def _beacon(data: bytes) -> StationAddress | None:
    """Return UUID/major/minor: after two bytes that say beacon, 16, 2 and 2, then the power."""
    if not data.startswith(_BEACON) or len(data) != _BEACON_BYTES:
        return None
    major, minor = (int.from_bytes(data[at : at + 2], "big") for at in (18, 20))
    return f"{UUID(bytes=data[2:18])}/{major}/{minor}"
