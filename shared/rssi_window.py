"""The readings of one station's signal strength, as a sliding window over time sees them.

Readings may be lost, late or repeated. They are only kept as they come, and looked at as of a
time, so that their order of arrival does not matter.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import fsum
from typing import NamedTuple


class Summary(NamedTuple):
    """A window summed up: mean time, mean and population variance of RSSI, number of samples."""

    time_ns: int
    mean_dbm: float
    variance_db2: float
    sample_count: int


def sum_up(rssi_dbm: Mapping[int, float]) -> Summary:
    """Sum up samples (n ≥ 1) that are given by their times (ns)."""
    count = len(rssi_dbm)
    mean_dbm = fsum(rssi_dbm.values()) / count
    variance_db2 = fsum((value - mean_dbm) ** 2 for value in rssi_dbm.values()) / count
    return Summary(sum(rssi_dbm) // count, mean_dbm, variance_db2, count)


class Readings:
    """Signal strengths (dBm) of one station, by their times (ns)."""

    def __init__(self) -> None:
        self._rssi_dbm: dict[int, float] = {}

    def __bool__(self) -> bool:
        return bool(self._rssi_dbm)

    def add(self, time_ns: int, rssi_dbm: float) -> None:
        """Keep a reading; of several at one time the strongest, whichever came first."""
        self._rssi_dbm[time_ns] = max(rssi_dbm, self._rssi_dbm.get(time_ns, rssi_dbm))

    def forget_until(self, time_ns: int) -> None:
        """Drop what is not after ``time_ns``."""
        self._rssi_dbm = {time: dbm for time, dbm in self._rssi_dbm.items() if time > time_ns}

    def between(self, after_ns: int, until_ns: int) -> dict[int, float]:
        """Return what is after ``after_ns`` and not after ``until_ns``: the future waits."""
        return {time: dbm for time, dbm in self._rssi_dbm.items() if after_ns < time <= until_ns}
