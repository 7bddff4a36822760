"""Which of a GNSS receiver's fixes and speeds are worth telling, and how sure they are."""

from __future__ import annotations

from typing import Annotated, NamedTuple, TypeAlias

import msgspec
from msgspec import Meta

from shared.messages import LocalPosition
from shared.units import NS_PER_S

Metres: TypeAlias = Annotated[float, Meta(gt=0.0, le=1000.0)]


class GnssReading(NamedTuple):
    """A receiver's fix: metres of the incident's frame, and its own horizontal deviation.

    ``sd_m`` is in each direction.
    """

    time_ns: int
    north_m: float
    east_m: float
    down_m: float
    sd_m: float


class SpeedReading(NamedTuple):
    """A receiver's speed over ground, and its standard deviation."""

    time_ns: int
    speed_m_s: float
    sd_m_s: float


LEAST_SPEED_SD_M_S = 0.3
"""No speed is taken to be better: it is of some moment of the last second."""

UNSAID_SPEED_SD_M_S = 1.0
WORST_SPEED_SD_M_S = 3.0
FASTEST_M_S = 75.0


def speed_reading(time_ns: int, speed_m_s: float, sd_m_s: float) -> SpeedReading | None:
    """Return a phone's reading of its speed, ``None`` if it has none that is worth anything.

    Phones say by −1, or by no number, what they do not know: the speed, or how good it is.
    """
    if not 0.0 <= speed_m_s <= FASTEST_M_S:
        return None
    known_sd_m_s = sd_m_s if sd_m_s >= 0.0 else UNSAID_SPEED_SD_M_S
    if known_sd_m_s > WORST_SPEED_SD_M_S:
        return None
    return SpeedReading(time_ns, speed_m_s, max(known_sd_m_s, LEAST_SPEED_SD_M_S))


class GnssSettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """When a fix is told.

    One in ``period_s`` is, for the next ones err as it does, and only if the receiver gives it
    ``worst_sd_m`` at most: indoors fixes wander, and their receivers know. No fix is told to be
    better than ``least_sd_m``: beside walls receivers claim more than they hold.
    """

    period_s: Metres = 1.0
    worst_sd_m: Metres = 12.0
    least_sd_m: Metres = 2.0


class GnssGate:
    """Lets fixes pass that are worth telling."""

    def __init__(self, settings: GnssSettings) -> None:
        self._settings = settings
        self._told_ns: int | None = None

    def take(self, reading: GnssReading) -> LocalPosition | None:
        """Return what is to be told of ``reading``; ``None`` if nothing is."""
        if not reading.sd_m <= self._settings.worst_sd_m:
            return None
        if self._told_ns is not None:
            since_ns = reading.time_ns - self._told_ns
            # A clock that is set back begins anew.
            if 0 <= since_ns < self._settings.period_s * NS_PER_S:
                return None
        self._told_ns = reading.time_ns
        variance_m2 = max(reading.sd_m, self._settings.least_sd_m) ** 2
        return LocalPosition(
            north_m=reading.north_m,
            east_m=reading.east_m,
            down_m=reading.down_m,
            covariance_m2=(variance_m2, 0.0, variance_m2),
        )
