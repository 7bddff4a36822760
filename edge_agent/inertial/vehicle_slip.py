"""When a phone in a vehicle slides, falls or is turned in the hand: what no vehicle does.

The published method asks whether roll or pitch by the accelerometer range beyond a threshold. A
gyroscope tells sooner, and tells braking from slipping: a vehicle that brakes does not roll over.
The threshold adapts to the road: what shakes a phone on cobbles is no slip.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from edge_agent.inertial.vehicle_filter import GRAVITY_M_S2, Motion, VehicleFilter

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

BANKED_M_S2 = 0.4
MISSING_SDS = 2.0
UNEXPLAINED_M_S = 0.8
"""Of what is missing in a turn a bank explains so much, and as much as speed and level may be off
by so many standard deviations; the rest, summed up to that (Page's cumulative sum, 1954), is of a
hand that turns the phone about the vertical as slowly as a vehicle turns."""

MOST_SHARE = 0.6
"""Of a turn that is the vehicle's less is missing, by whatever its speed is told wrong."""

QUIET_S = 0.1
"""For so long the rate has to be usual until the slip is over."""

QUIET_SHARE = 0.3
"""Of the threshold: a hand that begins to turn, and ends, does so slowly."""


@dataclass
class SlipDetector:
    """Judges samples in order. Plain state."""

    usual_rad2_s2: float = (0.4 * LEAST_RATE_RAD_S / TIMES_USUAL) ** 2
    missing_m_s2: float = 0.0
    unexplained_m_s: float = 0.0
    suspected_s: float = 0.0
    """For how long a hand may have turned the phone by now."""
    quiet_s: float = math.inf
    slips: bool = False

    def step(self, motion: Motion, state: VehicleFilter, duration_s: float) -> bool:
        """Return whether the sensor turns in the vehicle of ``state`` at this sample."""
        roll_rad_s, pitch_rad_s, yaw_rad_s = motion.rate_rad_s
        level_rad_s = math.hypot(roll_rad_s, pitch_rad_s)
        centripetal_m_s2 = state.speed_m_s * yaw_rad_s
        missing_m_s2 = centripetal_m_s2 - motion.acceleration_m_s2[1]
        self.missing_m_s2 += min(1.0, duration_s / MISSING_S) * (missing_m_s2 - self.missing_m_s2)
        slips = (
            level_rad_s > self.threshold_rad_s
            or abs(yaw_rad_s) > FASTEST_TURN_RAD_S
            or abs(centripetal_m_s2) > HARDEST_TURN_M_S2
            or min(abs(self.missing_m_s2), abs(centripetal_m_s2)) > MISSING_M_S2
            or self._is_turned(centripetal_m_s2, self._explained_m_s2(state, yaw_rad_s), duration_s)
        )
        moves = slips or (self.slips and level_rad_s > QUIET_SHARE * self.threshold_rad_s)
        self.quiet_s = 0.0 if moves else self.quiet_s + duration_s
        self.slips = self.quiet_s < QUIET_S
        if self.slips:
            return True
        weight = min(1.0, duration_s / USUAL_S)
        self.usual_rad2_s2 += weight * (level_rad_s * level_rad_s - self.usual_rad2_s2)
        return False

    def _explained_m_s2(self, state: VehicleFilter, yaw_rad_s: float) -> float:
        doubted_m_s2 = abs(yaw_rad_s) * state.speed_sd_m_s + GRAVITY_M_S2 * state.tilt_sd_rad
        return BANKED_M_S2 + MISSING_SDS * doubted_m_s2

    def _is_turned(self, centripetal_m_s2: float, explained_m_s2: float, duration_s: float) -> bool:
        """Return whether a hand turns the phone about the vertical, however slowly."""
        missing_m_s2 = math.copysign(1.0, centripetal_m_s2) * self.missing_m_s2
        most = missing_m_s2 > MOST_SHARE * abs(centripetal_m_s2)
        seen_m_s2 = min(missing_m_s2, abs(centripetal_m_s2)) if most else 0.0
        if self.slips:
            self.unexplained_m_s = self.suspected_s = 0.0
            return seen_m_s2 > explained_m_s2
        self.unexplained_m_s += (seen_m_s2 - explained_m_s2) * duration_s
        self.suspected_s += duration_s
        if self.unexplained_m_s <= 0.0:
            self.unexplained_m_s = self.suspected_s = 0.0
        return self.unexplained_m_s > UNEXPLAINED_M_S

    @property
    def suspects(self) -> bool:
        """Whether a hand may be turning the phone: half of what would be sure is missing."""
        return self.unexplained_m_s > 0.5 * UNEXPLAINED_M_S

    @property
    def threshold_rad_s(self) -> float:
        """Rate about level axes beyond which the sensor slips."""
        return max(LEAST_RATE_RAD_S, TIMES_USUAL * math.sqrt(self.usual_rad2_s2))
