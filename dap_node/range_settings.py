"""What the filter over range is set to and says, apart from what computes it."""

from __future__ import annotations

from typing import Annotated, NamedTuple, TypeAlias

import msgspec
from msgspec import Meta

Decibel: TypeAlias = Annotated[float, Meta(gt=0.0, le=60.0)]
Share: TypeAlias = Annotated[float, Meta(ge=0.0, lt=1.0)]
LogOdds: TypeAlias = Annotated[float, Meta(ge=-20.0, le=20.0)]


class RangeSettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """What the filter takes radio and people to be like.

    Near is within ``near_m``; one comes near when the log odds of that are at least
    ``enter_log_odds``, and leaves when they are below ``leave_log_odds``, both as the mean of the
    last ``steady_s``: a fade is not nearness. Power falls with range to the ``exponent``, readings
    spread by ``spread_db``, and say something new once in ``coherence_s``; the body takes
    ``body_loss_db`` of a ``body_share`` of them. Links differ by ``offset_sd_db``. From farther
    than ``far_m`` readings have the mean ``far_dbm`` and spread by ``far_spread_db``. Antennas are
    ``height_m`` apart in height, people spread out by ``diffusion_m2_s``, and nobody is farther
    than ``farthest_m``.
    """

    near_m: Annotated[float, Meta(ge=0.3, le=20.0)] = 2.5
    enter_log_odds: LogOdds = -1.5
    leave_log_odds: LogOdds = -2.5
    steady_s: Annotated[float, Meta(ge=0.0, le=60.0)] = 2.0
    exponent: Annotated[float, Meta(ge=1.0, le=6.0)] = 2.2
    spread_db: Decibel = 6.0
    coherence_s: Annotated[float, Meta(gt=0.0, le=60.0)] = 1.0
    body_loss_db: Decibel = 10.0
    body_share: Share = 0.3
    offset_sd_db: Decibel = 3.0
    far_m: Annotated[float, Meta(ge=1.0, le=200.0)] = 11.0
    far_dbm: Annotated[float, Meta(ge=-200.0, le=100.0)] = -75.0
    far_spread_db: Decibel = 10.0
    height_m: Annotated[float, Meta(gt=0.0, le=10.0)] = 0.5
    diffusion_m2_s: Annotated[float, Meta(gt=0.0, le=100.0)] = 2.0
    farthest_m: Annotated[float, Meta(ge=1.0, le=200.0)] = 15.0

    def __post_init__(self) -> None:
        """Refuse odds that it takes more to keep than to reach, and a far that is near."""
        if self.leave_log_odds > self.enter_log_odds:
            raise ValueError("leave_log_odds: put it at or below enter_log_odds")
        if not 2.0 * self.near_m <= self.far_m < self.farthest_m:
            raise ValueError("far_m: put it between twice near_m and farthest_m")


class Belief(NamedTuple):
    """What is held of somebody: the log odds that they are near, and moments.

    The range (m) and the link's offset (dB) are given by mean and standard deviation.
    """

    log_odds: float
    range_m: float
    range_sd_m: float
    offset_db: float
    offset_sd_db: float
