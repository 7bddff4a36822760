"""Landings of either foot, from how the trunk is pushed up: one push a step.

The trunk is caught at each landing, and thrown from the other leg; between, it falls. So vertical
acceleration, without what shakes faster than a step, has one top a step, in any gait. A top counts
that stands out on both sides; by how much goes by the tops before it as well, for a hard walker
shakes more than a slow one steps. Who sets out falls first, or pushes off: the top before that is
the first after a rest, and no foot has landed yet.
"""

from __future__ import annotations

import math
from collections import deque
from statistics import median
from typing import NamedTuple

from edge_agent.inertial.butterworth import LowPass
from shared.units import NS_PER_S


class LandingSettings(NamedTuple):
    """``least_m_s2`` is how far a top stands out at least, ``share`` that of the usual ones."""

    cutoff_hz: float = 2.8
    least_m_s2: float = 0.5
    share: float = 0.12
    remembered: int = 4
    """So many tops are what is usual."""
    quick_step_s: float = 0.36
    quick_m_s2: float = 8.0
    """Who makes quicker steps runs, and is thrown up by as much."""
    shortest_step_s: float = 0.22
    longest_step_s: float = 1.3
    """After so long the walk was interrupted, and what is usual begins anew."""


class Landing(NamedTuple):
    """When the trunk was pushed up most; ``setting_out`` if that was no landing yet."""

    time_ns: int
    setting_out: bool


class LandingDetector:
    """Tops of upward acceleration that stand out, told as soon as it has fallen as far again."""

    def __init__(self, rate_hz: float, settings: LandingSettings | None = None) -> None:
        self._settings = settings or LandingSettings()
        self._low_pass = LowPass(self._settings.cutoff_hz, rate_hz)
        self._rises_m_s2: deque[float] = deque(maxlen=self._settings.remembered)
        self._rising = True
        self._extreme_m_s2 = 0.0
        self._extreme_ns = 0
        self._bottom_m_s2 = 0.0
        self._landed_ns: int | None = None

    def step(self, time_ns: int, up_m_s2: float) -> Landing | None:
        """Take in the next upward acceleration; return the landing that is now sure, if any is."""
        value = self._low_pass.step(up_m_s2)
        beyond = value - self._extreme_m_s2 if self._rising else self._extreme_m_s2 - value
        # What nothing has followed for so long was no step's.
        stale = (time_ns - self._extreme_ns) / NS_PER_S > self._settings.longest_step_s
        if beyond > 0.0 or stale:
            self._extreme_m_s2, self._extreme_ns = value, time_ns
            return None
        if -beyond <= self._standing_out_m_s2(time_ns):
            return None
        turned_m_s2, turned_ns = self._extreme_m_s2, self._extreme_ns
        self._rising = not self._rising
        self._extreme_m_s2, self._extreme_ns = value, time_ns
        if self._rising:
            self._bottom_m_s2 = turned_m_s2
            return None
        return self._land(turned_ns, turned_m_s2 - self._bottom_m_s2)

    def _standing_out_m_s2(self, now_ns: int) -> float:
        if self._pause_s(now_ns) > self._settings.longest_step_s:
            self._rises_m_s2.clear()
        usual_m_s2 = median(self._rises_m_s2) if self._rises_m_s2 else 0.0
        return max(self._settings.least_m_s2, self._settings.share * usual_m_s2)

    def _land(self, time_ns: int, rise_m_s2: float) -> Landing | None:
        settings, pause_s = self._settings, self._pause_s(time_ns)
        if pause_s < settings.shortest_step_s:
            return None
        if pause_s < settings.quick_step_s and rise_m_s2 < settings.quick_m_s2:
            return None
        self._rises_m_s2.append(rise_m_s2)
        self._landed_ns = time_ns
        return Landing(time_ns, pause_s > settings.longest_step_s)

    def _pause_s(self, now_ns: int) -> float:
        if self._landed_ns is None:
            return math.inf
        return (now_ns - self._landed_ns) / NS_PER_S
