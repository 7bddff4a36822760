"""Which of a GNSS receiver's fixes are worth telling, and how sure they are told to be."""

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
