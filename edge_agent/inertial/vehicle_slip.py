"""When a phone in a vehicle slides, falls or is turned in the hand: what no vehicle does.

The published method asks whether roll or pitch by the accelerometer range beyond a threshold. A
gyroscope tells sooner, and tells braking from slipping: a vehicle that brakes does not roll over.
The threshold adapts to the road: what shakes a phone on cobbles is no slip.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from edge_agent.inertial.vehicle_filter import Motion

LEAST_RATE_RAD_S = 0.5
"""About level axes: a speed bump pitches a car by less."""

TIMES_USUAL = 8.0
USUAL_S = 10.0
"""A slip is so many times faster than the root mean square of so long."""

FASTEST_TURN_RAD_S = 1.0
HARDEST_TURN_M_S2 = 9.0
"""About the vertical: a vehicle turns no faster, and is not pressed harder to the side."""

MISSING_M_S2 = 2.5
MISSING_S = 0.3
"""Centripetal acceleration that a turn should have and, over so long, has not: the phone turns."""

QUIET_S = 0.1
"""For so long the rate has to be usual until the slip is over."""

QUIET_SHARE = 0.3
"""Of the threshold: a hand that begins to turn, and ends, does so slowly."""


@dataclass
class SlipDetector:
    """Judges samples in order. Plain state."""

    usual_rad2_s2: float = (0.4 * LEAST_RATE_RAD_S / TIMES_USUAL) ** 2
    missing_m_s2: float = 0.0
    quiet_s: float = math.inf
    slips: bool = False

    def step(self, motion: Motion, speed_m_s: float, duration_s: float) -> bool:
        """Return whether the sensor turns in the vehicle at this sample."""
        roll_rad_s, pitch_rad_s, yaw_rad_s = motion.rate_rad_s
        level_rad_s = math.hypot(roll_rad_s, pitch_rad_s)
        centripetal_m_s2 = speed_m_s * yaw_rad_s
        missing_m_s2 = centripetal_m_s2 - motion.acceleration_m_s2[1]
        self.missing_m_s2 += min(1.0, duration_s / MISSING_S) * (missing_m_s2 - self.missing_m_s2)
        slips = (
            level_rad_s > self.threshold_rad_s
            or abs(yaw_rad_s) > FASTEST_TURN_RAD_S
            or abs(centripetal_m_s2) > HARDEST_TURN_M_S2
            or min(abs(self.missing_m_s2), abs(centripetal_m_s2)) > MISSING_M_S2
        )
        moves = slips or (self.slips and level_rad_s > QUIET_SHARE * self.threshold_rad_s)
        self.quiet_s = 0.0 if moves else self.quiet_s + duration_s
        self.slips = self.quiet_s < QUIET_S
        if self.slips:
            return True
        weight = min(1.0, duration_s / USUAL_S)
        self.usual_rad2_s2 += weight * (level_rad_s * level_rad_s - self.usual_rad2_s2)
        return False

    @property
    def threshold_rad_s(self) -> float:
        """Rate about level axes beyond which the sensor slips."""
        return max(LEAST_RATE_RAD_S, TIMES_USUAL * math.sqrt(self.usual_rad2_s2))
