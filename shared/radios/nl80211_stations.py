"""What the kernel answers of the stations of a Wi-Fi interface, taken apart (pure).

Attributes are those of ``NL80211_CMD_GET_STATION`` in the kernel's ``nl80211.h``: signals in whole
dBm, the time since anything was received in milliseconds.
"""

from __future__ import annotations

from typing import Any, Protocol

from shared.radios.station_counters import Polled, known_dbm
from shared.stations import parse_address


class Attributes(Protocol):
    """A netlink message, or what is nested in one."""

    def get_attr(self, name: str) -> Any:
        """Return the attribute of that name; ``None`` if there is none."""


def polled_station(answer: Attributes) -> Polled | None:
    """Return what one message of a station dump tells; ``None`` if it is of no station."""
    mac, told = answer.get_attr("NL80211_ATTR_MAC"), answer.get_attr("NL80211_ATTR_STA_INFO")
    if mac is None or told is None:
        return None

    def of(name: str) -> Any:
        return told.get_attr(f"NL80211_STA_INFO_{name}")

    received = (of("RX_PACKETS"), of("RX_BYTES64") or of("RX_BYTES"))
    chains = of("CHAIN_SIGNAL")
    return Polled(
        parse_address(mac),
        tuple(count for count in received if count is not None),
        known_dbm(of("SIGNAL")),
        known_dbm(of("SIGNAL_AVG")),
        tuple(float(dbm) for dbm in chains) if isinstance(chains, list | tuple) else (),
        of("INACTIVE_TIME") or 0,
    )
