"""What a radio hears, by the addresses of those who send (pure)."""

from __future__ import annotations

from typing import NamedTuple

from shared.messages import StationAddress


class ScannerError(ValueError):
    """A source cannot be used. The text names it, what is wrong, and what to do."""


class Reading(NamedTuple):
    """The signal strength of a radio, and how long before the scan it was heard.

    ``average_dbm`` is the driver's running mean, ``chains_dbm`` is what each antenna heard, where
    the driver tells them. ``aliases`` are what else the radio calls itself.
    """

    address: StationAddress
    rssi_dbm: float
    age_ns: int = 0
    average_dbm: float | None = None
    chains_dbm: tuple[float, ...] = ()
    aliases: tuple[StationAddress, ...] = ()

    @property
    def names(self) -> tuple[StationAddress, ...]:
        """All that the radio calls itself."""
        return (self.address, *self.aliases)


class RadioScan(NamedTuple):
    """One look at all stations by their addresses: whose they are is for the table to say."""

    time_ns: int
    readings: tuple[Reading, ...]
