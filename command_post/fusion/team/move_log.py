"""A responder's increments, kept in the order of their time, whenever they came."""

from __future__ import annotations

import zlib
from typing import NamedTuple, TypeAlias

import msgspec
import numpy as np
from numpy.typing import NDArray

from shared.messages import OdometryIncrement

Floats: TypeAlias = NDArray[np.float64]
Ints: TypeAlias = NDArray[np.int64]

BLOCK, UNPACKED = 256, 512
"""Messages are packed so many at a time; so many of the newest are not."""

NORTH, EAST, DOWN, HEADING, PLACE_M2, TURN_RAD2, DOWN_M2 = range(7)
"""Columns of ``Moves.values``."""


class Moves(NamedTuple):
    """A responder's increments by time: ``end_ns``, ``start_ns``, ``sequence`` (m,), values (m, 7).

    The values' columns are named above: displacement in the agent's frame (m), the agent's
    heading at the end (rad), and published variances of a horizontal axis, of turn and of height.
    """

    end_ns: Ints
    start_ns: Ints
    sequence: Ints
    values: Floats


class MoveLog:
    """Increments in the order of their time; one that is late is put where it belongs.

    What was told long ago is rarely asked for as it was told: but for the newest, the messages are
    kept packed, ``BLOCK`` by ``BLOCK``.
    """

    def __init__(self) -> None:
        self._times = np.empty((64, 3), np.int64)
        self._values = np.empty((64, 7))
        self._packed: list[bytes] = []
        self._messages: list[OdometryIncrement] = []
        """Those behind the packed ones."""

        self._skipped = 0
        """So many of the first packed ones are not of this log."""

        self._count = 0
        self._newest = (-1, -1)
        """When the last move ended, and its number."""

        self.order = object()
        """Another one as soon as a move is put before others, or the first are dropped."""

    def __len__(self) -> int:
        return self._count

    def __getstate__(self) -> tuple[Ints, Floats, list[bytes], bytes, int]:
        """Return it packed: the messages as on the wire, which is many times as fast."""
        count, messages = self._count, msgspec.msgpack.encode(self._messages)
        return self._times[:count], self._values[:count], self._packed, messages, self._skipped

    def __setstate__(self, state: tuple[Ints, Floats, list[bytes], bytes, int]) -> None:
        """Take what ``__getstate__`` returned."""
        times, values, packed, messages, skipped = state
        self.__init__()  # type: ignore[misc]
        self._times = np.concatenate([times, self._times])
        self._values = np.concatenate([values, self._values])
        self._packed = packed
        self._messages = msgspec.msgpack.decode(messages, type=list[OdometryIncrement])
        self._skipped = skipped
        self._count = len(times)
        self._newest = self._mark(self._count - 1)

    def add(self, increment: OdometryIncrement) -> bool:
        """Take it in; ``False`` if it was here before."""
        if self._count == len(self._times):
            self._times = np.concatenate([self._times, np.empty_like(self._times)])
            self._values = np.concatenate([self._values, np.empty_like(self._values)])
        mark = (increment.event_time_ns, increment.sequence)
        at = self._count
        if mark <= self._newest:
            while at and self._mark(at - 1) > mark:
                at -= 1
            if at and self._mark(at - 1) == mark:
                return False
            self._make_room(at)
        else:
            self._newest = mark
        self._insert(at, increment)
        self._times[at] = increment.event_time_ns, increment.start_time_ns, increment.sequence
        nn, _, _, _, ee, _, _, dd, _, hh = increment.covariance
        self._values[at] = (
            increment.d_north_m, increment.d_east_m, increment.d_down_m, increment.heading_rad,
            0.5 * max(nn + ee, 0.0), max(hh, 0.0), max(dd, 0.0),
        )  # fmt: skip
        self._count += 1
        return True

    def _mark(self, at: int) -> tuple[int, int]:
        """Return when a move ended, and its number."""
        end_ns, _, number = self._times[at].tolist() if at >= 0 else (-1, -1, -1)
        return end_ns, number

    def _make_room(self, at: int) -> None:
        for table in (self._times, self._values):
            table[at + 1 : self._count + 1] = table[at : self._count].copy()
        self.order = object()

    def _insert(self, at: int, increment: OdometryIncrement) -> None:
        """Put a message at its place, those behind it being unpacked for that."""
        while at < len(self._packed) * BLOCK:
            self._messages = _unpack(self._packed.pop()) + self._messages
        self._messages.insert(at - len(self._packed) * BLOCK, increment)
        # While late ones come to one place they are not packed again each time.
        while at == self._count and len(self._messages) >= UNPACKED + BLOCK:
            self._packed.append(_pack(self._messages[:BLOCK]))
            self._messages = self._messages[BLOCK:]

    def _told_since(self, first: int) -> list[OdometryIncrement]:
        first += self._skipped
        block, behind = divmod(first, BLOCK)
        packed = [each for data in self._packed[block:] for each in _unpack(data)]
        if packed:
            return packed[behind:] + self._messages
        return self._messages[first - len(self._packed) * BLOCK :]

    @property
    def last_heading_rad(self) -> float:
        """The agent's heading at the end of the last move; 0 before any."""
        return float(self._values[self._count - 1, HEADING]) if self._count else 0.0

    def until(self, time_ns: int) -> Moves:
        """Return the moves that ended by ``time_ns``, without copying them."""
        count = self.count_until(time_ns)
        end_ns, start_ns, sequence = self._times[:count].T
        return Moves(end_ns, start_ns, sequence, self._values[:count])

    def messages_until(self, time_ns: int) -> list[OdometryIncrement]:
        """Return the moves that ended by ``time_ns`` as they were told."""
        return self._told_since(0)[: self.count_until(time_ns)]

    def messages_after(self, time_ns: int) -> list[OdometryIncrement]:
        """Return the moves that ended after ``time_ns`` as they were told."""
        return self._told_since(self.count_until(time_ns))

    def later_than(self, time_ns: int) -> MoveLog:
        """Return the log of the moves that ended after ``time_ns``, to be read only."""
        first = self.count_until(time_ns)
        later = MoveLog()
        later._times = self._times[first : self._count]
        later._values = self._values[first : self._count]
        packed = min((first + self._skipped) // BLOCK, len(self._packed))
        later._packed = self._packed[packed:]
        later._skipped = first + self._skipped - packed * BLOCK
        later._messages = self._messages.copy()
        later._count = self._count - first
        later._newest = self._newest if later._count else later._newest
        return later

    def forget(self, time_ns: int) -> None:
        """Drop moves that ended by ``time_ns``: as many whole blocks as are packed, the first."""
        blocks = min(self.count_until(time_ns) // BLOCK, len(self._packed))
        if blocks:
            first = blocks * BLOCK
            self._times = self._times[first : self._count].copy()
            self._values = self._values[first : self._count].copy()
            del self._packed[:blocks]
            self._count -= first
            self.order = object()

    def count_until(self, time_ns: int) -> int:
        """Return how many moves ended by ``time_ns``."""
        return int(self._times[: self._count, 0].searchsorted(time_ns, side="right"))

    def rows(self, first: int, end: int) -> tuple[list[list[int]], list[list[float]]]:
        """Return some moves' ends, starts and numbers, and their values (see ``Moves``)."""
        return self._times[first:end].tolist(), self._values[first:end].tolist()


def _pack(messages: list[OdometryIncrement]) -> bytes:
    return zlib.compress(msgspec.msgpack.encode(messages), 1)


def _unpack(packed: bytes) -> list[OdometryIncrement]:
    return msgspec.msgpack.decode(zlib.decompress(packed), type=list[OdometryIncrement])
