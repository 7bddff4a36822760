"""The way back to where one came in, as one's own movements tell it (pure).

What was walked and walked back, as in and out of a room, is no part of it: the loop-erased path
(Lawler, "A self-avoiding random walk", 1980). How straight it is tells how many will come along it:
where ways part, so do those who walk them, and each parting bends it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple, TypeAlias

Place: TypeAlias = tuple[float, float]


class _Stop(NamedTuple):
    """A place (north, east) on the way, and how far it is from where one came in."""

    way_m: float
    place_m: Place


class WayBack:
    """Takes in movements on level ground; holds the way back without its loops.

    Who comes within ``meets_m`` of where the way was ``least_loop_m`` or more ago is there again,
    and what lies between is forgotten.
    """

    def __init__(self, meets_m: float, least_loop_m: float) -> None:
        self._meets_m, self._least_loop_m = meets_m, least_loop_m
        self._stops = [_Stop(0.0, (0.0, 0.0))]

    @property
    def here_m(self) -> Place:
        """Where one is (north, east), from where one came in."""
        return self._stops[-1].place_m

    @property
    def length_m(self) -> float:
        """How long the way back is."""
        return self._stops[-1].way_m

    def come_in(self) -> None:
        """Begin anew here: another storey, which all who go there come in by."""
        self._stops = [_Stop(0.0, (0.0, 0.0))]

    def walk(self, north_m: float, east_m: float) -> None:
        """Take in a movement."""
        here_m = (self.here_m[0] + north_m, self.here_m[1] + east_m)
        way_m = self.length_m + math.hypot(north_m, east_m)
        for number, stop in enumerate(self._stops):
            if way_m - stop.way_m < self._least_loop_m:
                break
            apart_m = math.dist(stop.place_m, here_m)
            if apart_m < self._meets_m:
                del self._stops[number + 1 :]
                way_m = stop.way_m + apart_m
                break
        self._stops.append(_Stop(way_m, here_m))

    def straightness(self, last_m: float) -> float:
        """Return how far the last metres of the way lead over how long they are: 1 if straight."""
        first, last = self._since(last_m), self._stops[-1]
        if last.way_m <= first.way_m:
            return 1.0
        return min(math.dist(first.place_m, last.place_m) / (last.way_m - first.way_m), 1.0)

    def direction(self, last_m: float, least: float) -> Place | None:
        """Return which way (north, east; a unit vector) the last metres lead.

        ``None`` where the way is not as long yet, or less straight than ``least``.
        """
        if self.length_m < last_m or self.straightness(last_m) <= least:
            return None
        first_m, here_m = self._since(last_m).place_m, self.here_m
        got_m = math.dist(first_m, here_m)
        return (here_m[0] - first_m[0]) / got_m, (here_m[1] - first_m[1]) / got_m

    def _since(self, last_m: float) -> _Stop:
        """Return the last stop that is so far back along the way, or the first."""
        return _last_before(self._stops, self.length_m - last_m)


def _last_before(stops: Sequence[_Stop], way_m: float) -> _Stop:
    for stop in reversed(stops):
        if stop.way_m <= way_m:
            return stop
    return stops[0]
