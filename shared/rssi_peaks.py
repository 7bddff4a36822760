"""When somebody passed: the moment a transmitter was loudest, and how loud, while it happens.

A threshold on signal strength tells that somebody is within some metres; the moment of its peak
tells when they were nearest, and the stronger the peak, the nearer. A DAP finds so who passes it,
a responder's unit whom it meets.

Readings may be lost, late or repeated. They are only kept as they come; every decision is made in
``tick``, from what is then in the window, so that their order of arrival does not matter.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import takewhile
from math import fsum, inf
from typing import Annotated, NamedTuple, TypeAlias

import msgspec
from msgspec import Meta

from shared.messages import NodeId
from shared.rssi_window import Readings, sum_up
from shared.units import NS_PER_S

Dbm: TypeAlias = Annotated[float, Meta(ge=-200.0, le=100.0)]
Decibel: TypeAlias = Annotated[float, Meta(gt=0.0, le=60.0)]
Duration: TypeAlias = Annotated[float, Meta(gt=0.0, le=60.0)]


class PeakSettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """What counts as a peak of signal strength.

    The level is the mean of the readings (dBm) of the last ``window_s``, of which there must be
    ``least_samples``. A climb begins when the level is at least ``arm_dbm``, and after a peak not
    before it is ``fall_db`` above the lowest since, or after ``silence_s`` without a reading: who
    stands still is told once. It ends in a peak when the level has fallen by ``fall_db``, or has
    not become higher for ``hold_s``. The peak lasts while the level is within ``width_db`` of the
    highest; its moment is the middle of the readings that are, no more than ``middle_s`` from the
    highest level, for the wearer's body may cut off one side of a peak.
    """

    window_s: Duration = 1.5
    least_samples: Annotated[int, Meta(ge=1, le=1000)] = 3
    arm_dbm: Dbm = -60.0
    fall_db: Decibel = 4.0
    hold_s: Duration = 4.0
    width_db: Decibel = 6.0
    middle_s: Duration = 1.5
    silence_s: Duration = 3.0

    def __post_init__(self) -> None:
        """Refuse to forget, or to leave out of a peak, what its level is made of."""
        if self.middle_s < self.window_s:
            raise ValueError("middle_s: put it at or above window_s")
        if self.silence_s < self.window_s:
            raise ValueError("silence_s: put it at or above window_s")


class Peak(NamedTuple):
    """A station was loudest at ``time_ns``, for ``width_s``.

    ``time_ns`` is the mean time of ``sample_count`` readings, weighted with their power, and
    ``peak_dbm`` the highest level.
    """

    time_ns: int
    station_id: NodeId
    peak_dbm: float
    width_s: float
    sample_count: int


class _Level(NamedTuple):
    """What a window comes to: mean time of its readings, and their mean."""

    time_ns: int
    dbm: float


@dataclass
class _Climb:
    """A peak that may still grow: its levels in the order of time, and the highest of them."""

    levels: list[_Level]
    highest: _Level


class PeakDetector:
    """Follows the signal of every station heard, and says when each was loudest."""

    def __init__(self, settings: PeakSettings) -> None:
        self._settings = settings
        self._stations: dict[NodeId, _Station] = {}

    @property
    def hears_nobody(self) -> bool:
        """Whether there is nothing to remember."""
        return not self._stations

    def add(self, time_ns: int, station_id: NodeId, rssi_dbm: float) -> None:
        """Keep a reading. Of several at one time the strongest counts, whichever came first."""
        station = self._stations.setdefault(station_id, _Station(station_id, self._settings))
        station.readings.add(time_ns, rssi_dbm)

    def tick(self, now_ns: int) -> list[Peak]:
        """Return the peaks that are over, by station. ``now_ns`` must not go back."""
        told = [station.tick(now_ns) for _, station in sorted(self._stations.items())]
        self._stations = {
            station_id: station
            for station_id, station in self._stations.items()
            if station.readings
        }
        return [peak for peak in told if peak is not None]


class _Station:
    """One station: its newest readings, and the climb to a peak if there is one."""

    def __init__(self, station_id: NodeId, settings: PeakSettings) -> None:
        self.readings = Readings()
        self._station_id = station_id
        self._settings = settings
        self._climb: _Climb | None = None
        self._lowest_dbm = -inf

    def tick(self, now_ns: int) -> Peak | None:
        """Return the peak if one is over now."""
        heard = self.readings.between(now_ns - _ns(self._settings.window_s), now_ns)
        is_level = len(heard) >= self._settings.least_samples
        level = _Level(*sum_up(heard)[:2]) if is_level else None
        if self._climb is not None:
            return self._follow(self._climb, level, now_ns)
        self.readings.forget_until(now_ns - _ns(self._settings.silence_s))
        if level is not None:
            self._lowest_dbm = min(self._lowest_dbm, level.dbm)
            if level.dbm >= max(self._settings.arm_dbm, self._lowest_dbm + self._settings.fall_db):
                self._climb = _Climb([level], level)
        return None

    def _follow(self, climb: _Climb, level: _Level | None, now_ns: int) -> Peak | None:
        """Take in the next level if there is one; return the peak if the climb is over."""
        # A late reading may bring the middle of the window back.
        if level is not None and level.time_ns > climb.levels[-1].time_ns:
            climb.levels.append(level)
            if level.dbm > climb.highest.dbm:
                climb.highest = level
                self.readings.forget_until(level.time_ns - _ns(self._settings.middle_s) - 1)
        last = climb.levels[-1]
        is_fallen = last.dbm <= climb.highest.dbm - self._settings.fall_db
        if not is_fallen and now_ns - climb.highest.time_ns < _ns(self._settings.hold_s):
            return None
        self._climb, self._lowest_dbm = None, last.dbm
        return self._sum_up(climb)

    def _sum_up(self, climb: _Climb) -> Peak:
        """Tell the peak of a climb that is over."""
        peak_ns, peak_dbm = climb.highest
        least_dbm = peak_dbm - self._settings.width_db
        middle_ns = _ns(self._settings.middle_s)
        around = self.readings.between(peak_ns - middle_ns - 1, peak_ns + middle_ns)
        power = {
            time_ns - peak_ns: 10.0 ** ((rssi_dbm - peak_dbm) / 10.0)
            for time_ns, rssi_dbm in around.items()
            if rssi_dbm >= least_dbm
        }
        after_ns = fsum(time_ns * weight for time_ns, weight in power.items()) / fsum(
            power.values()
        )
        return Peak(
            peak_ns + round(after_ns),
            self._station_id,
            peak_dbm,
            _width_ns(climb, least_dbm) / NS_PER_S,
            len(power),
        )


def _width_ns(climb: _Climb, least_dbm: float) -> int:
    """Return for how long the level was at least ``least_dbm`` without a break, at the highest."""
    before = takewhile(
        lambda level: level.dbm >= least_dbm,
        (level for level in reversed(climb.levels) if level.time_ns <= climb.highest.time_ns),
    )
    after = takewhile(
        lambda level: level.dbm >= least_dbm,
        (level for level in climb.levels if level.time_ns >= climb.highest.time_ns),
    )
    return max(level.time_ns for level in after) - min(level.time_ns for level in before)


def _ns(duration_s: float) -> int:
    return round(duration_s * NS_PER_S)
