"""Foot strikes as published: peaks of upward acceleration at the waist."""

from __future__ import annotations

from typing import NamedTuple

from shared.units import NS_PER_S


class StrikeSettings(NamedTuple):
    """How high a peak is at least, and how far from the last. The paper gives neither."""

    least_m_s2: float = 1.5
    shortest_s: float = 0.3


class FootStrikes:
    """Highest moments above a threshold, told once no higher one can follow.

    "Gait information and pedestrian localisation with a 3-axis accelerometer": "steps from the z
    axis' foot-strike peaks". Of peaks nearer than ``shortest_s`` the highest is the strike.
    """

    def __init__(self, settings: StrikeSettings | None = None) -> None:
        self._settings = settings or StrikeSettings()
        self._peak_ns = 0
        self._peak_m_s2 = 0.0
        self._told_ns: int | None = None

    def step(self, time_ns: int, up_m_s2: float) -> int | None:
        """Take in the next upward acceleration; return when the strike was that is now sure."""
        apart_ns = self._settings.shortest_s * NS_PER_S
        if self._peak_m_s2 and time_ns - self._peak_ns >= apart_ns:
            struck_ns, self._peak_m_s2 = self._peak_ns, 0.0
            self._told_ns = struck_ns
            return struck_ns
        follows = self._told_ns is not None and time_ns - self._told_ns < apart_ns
        if up_m_s2 > max(self._settings.least_m_s2, self._peak_m_s2) and not follows:
            self._peak_ns, self._peak_m_s2 = time_ns, up_m_s2
        return None
