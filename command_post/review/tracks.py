"""Everybody's estimates in the order in which they were told, to be found by time (pure).

Of each is kept when it was told and where its message is, not the message: an hour of a large
crew fits into memory, and any moment of it is found at once.
"""

from __future__ import annotations

from array import array
from bisect import bisect_right
from typing import NamedTuple

from command_post.web.board import TRAIL_POINTS, TRAIL_SPACING_M
from shared.mcap_index import Spot
from shared.messages import NodeId, Vector3


class Told(NamedTuple):
    """An estimate: when it was told, and where its message is."""

    at_ns: int
    spot: Spot


class TrackBook:
    """The estimates of all responders; they are added in the order in which they were told."""

    def __init__(self) -> None:
        self._of: dict[NodeId, _Responder] = {}

    def add(self, responder_id: NodeId, at_ns: int, place_m: Vector3, spot: Spot) -> None:
        """Take in an estimate. A clock that was set back is taken to have stood still."""
        known = self._of.get(responder_id)
        if known is None:
            known = self._of[responder_id] = _Responder()
        known.add(at_ns, place_m, spot)

    def newest(self, at_ns: int) -> dict[NodeId, Told]:
        """Return what had been told last of each responder by ``at_ns``."""
        found = ((name, each.newest(at_ns)) for name, each in list(self._of.items()))
        return {name: told for name, told in found if told is not None}

    def trails(self, at_ns: int) -> dict[NodeId, list[Vector3]]:
        """Return the ways behind all responders as the page showed them at ``at_ns``."""
        found = ((name, each.trail(at_ns)) for name, each in list(self._of.items()))
        return {name: trail for name, trail in found if trail}


class _Responder:
    """One responder's estimates in columns, and the points of the way behind them.

    One thread adds while others look: a row counts once its time is there, which comes last.
    """

    def __init__(self) -> None:
        self._at_ns = array("q")
        self._chunk = array("q")
        self._offset = array("q")
        self._trail_ns = array("q")
        self._trail_m: list[Vector3] = []

    def add(self, at_ns: int, place_m: Vector3, spot: Spot) -> None:
        """Add an estimate: when it was told, of which place, and where in the recording it is."""
        at_ns = max(at_ns, self._at_ns[-1]) if self._at_ns else at_ns
        if not self._trail_m or _apart_m(place_m, self._trail_m[-1]) >= TRAIL_SPACING_M:
            self._trail_m.append(place_m)
            self._trail_ns.append(at_ns)
        self._chunk.append(spot.chunk)
        self._offset.append(spot.offset)
        self._at_ns.append(at_ns)

    def newest(self, at_ns: int) -> Told | None:
        row = bisect_right(self._at_ns, at_ns) - 1
        if row < 0:
            return None
        return Told(self._at_ns[row], Spot(self._chunk[row], self._offset[row]))

    def trail(self, at_ns: int) -> list[Vector3]:
        end = bisect_right(self._trail_ns, at_ns)
        return self._trail_m[max(end - TRAIL_POINTS, 0) : end]


def _apart_m(one: Vector3, other: Vector3) -> float:
    return max(abs(one[0] - other[0]), abs(one[1] - other[1]), abs(one[2] - other[2]))
