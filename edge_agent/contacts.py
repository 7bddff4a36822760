"""Whom the wearer meets: other responders' radios, heard by the unit, and when they were loudest.

What makes a peak is told in ``shared.rssi_peaks``.
"""

from __future__ import annotations

from shared.messages import NodeId
from shared.rssi_peaks import Peak, PeakDetector, PeakSettings
from shared.units import NS_PER_S

LOOK_NS = NS_PER_S // 5


class ContactWatch:
    """Hears the others, and says when each was loudest.

    It looks at what was heard at fixed times, so that it does not matter how often, nor when, it
    is told the time.
    """

    def __init__(self, settings: PeakSettings) -> None:
        self._detector = PeakDetector(settings)
        self._looked_ns: int | None = None

    def hear(self, time_ns: int, other_id: NodeId, rssi_dbm: float) -> None:
        """Take in a reading; of several at one time the strongest counts."""
        if self._looked_ns is None:
            self._looked_ns = time_ns - time_ns % LOOK_NS
        self._detector.add(time_ns, other_id, rssi_dbm)

    def pass_time(self, now_ns: int) -> list[Peak]:
        """Return the meetings that are over, in the order of being noticed."""
        met: list[Peak] = []
        while self._looked_ns is not None and now_ns - self._looked_ns >= LOOK_NS:
            self._looked_ns += LOOK_NS
            met += self._detector.tick(self._looked_ns)
            if self._detector.hears_nobody:
                self._looked_ns = None
        return met
