"""What a source gives an agent, in the order of its time."""

from __future__ import annotations

from collections.abc import Generator, Iterator
from typing import NamedTuple, TypeAlias

import msgspec

from edge_agent.cues import Cue
from edge_agent.drop_desk import Beacon
from edge_agent.gnss import SpeedReading
from edge_agent.mayday_controls import Control
from shared.messages import ImuSample, LocalPosition


class TruePlace(NamedTuple):
    """Where the boot really is, which only a simulation knows: metres north, east, down."""

    time_ns: int
    position_m: tuple[float, float, float]


class Quiet(NamedTuple):
    """Nothing came until then from a source that is live."""

    time_ns: int


Reading: TypeAlias = ImuSample | Cue | SpeedReading | Beacon | TruePlace | Quiet


class Source(NamedTuple):
    """Readings in the order of their time; ``begin_ns`` is the time they are counted from.

    ``start`` is where the wearer is known to stand at the beginning, ``None`` where the file
    does not say. ``controls`` are those by which its wearer may call for help.
    """

    readings: Iterator[Reading]
    begin_ns: int
    start: LocalPosition | None
    controls: tuple[Control, ...] = ()

    def beginning_at(self, begin_ns: int) -> Iterator[Reading]:
        """Yield the readings with their times moved so that they begin at ``begin_ns``."""
        by_ns = begin_ns - self.begin_ns
        try:
            for reading in self.readings:
                if isinstance(reading, ImuSample):
                    yield msgspec.structs.replace(reading, time_ns=reading.time_ns + by_ns)
                else:
                    yield reading._replace(time_ns=reading.time_ns + by_ns)
        finally:
            # A live source listens until it is told that nobody does.
            if isinstance(self.readings, Generator):
                self.readings.close()
