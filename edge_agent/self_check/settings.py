"""From where on a measure of the samples is a warning, and from where on a fault."""

from __future__ import annotations

import math
from typing import NamedTuple

from shared.messages import Mount


class SelfCheckSettings(NamedTuple):
    """Limits. Where there are two, the first is a warning's and the second a fault's.

    A sensor stands still while rates scatter by less than ``still_rad_s`` and force by less than
    ``still_m_s2``. A flat top is ``flat_samples`` of the same reading beyond ``high_m_s2`` or
    ``high_rad_s``. Whatever carries a sensor, in a second its largest reading of force is
    ``least_m_s2`` or more, and none reads a rate above ``most_rad_s``. ``nominal_rate_hz`` is what
    the sensor ought to run at, if that is known. ``bears_c`` is what most sensors are made for,
    ``near_c`` how near that a warning is given; ``drift_c_min`` is how fast a temperature changes
    that takes the gyro's bias along.
    """

    period_s: float = 10.0
    stall_s: float = 1.0
    nominal_rate_hz: float | None = None
    rate_share: float = 0.01
    missing: tuple[float, float] = (0.02, 0.2)
    unusable: tuple[float, float] = (0.0, 0.05)
    flat_samples: int = 3
    high_m_s2: float = 30.0
    high_rad_s: float = 3.5
    flat_top: tuple[float, float] = (0.001, 0.01)
    still_rad_s: float = 0.03
    still_m_s2: float = 0.15
    bias_rad_s: tuple[float, float] = (math.radians(2.0), math.radians(6.0))
    gravity_m_s2: float = 9.81
    gravity_off_m_s2: tuple[float, float] = (0.4, 1.2)
    stuck_seconds: int = 3
    least_m_s2: float = 3.0
    most_rad_s: float = 40.0
    moving_m_s2: float = 1.0
    moving_rad_s: float = 0.3
    long_swing_s: float = 3.0
    no_stance: tuple[float, float] = (0.3, 0.6)
    bears_c: tuple[float, float] = (-40.0, 85.0)
    near_c: float = 15.0
    drift_c_min: float = 6.0


SLOW_HZ: dict[Mount, tuple[float, float]] = {
    "vehicle": (80.0, 40.0),
    "chest": (20.0, 10.0),
    "waist": (20.0, 10.0),
}
"""Rates below which a mount tells less, and next to nothing: the road is heard at 50 to 100 Hz."""
