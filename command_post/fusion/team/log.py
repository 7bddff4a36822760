"""All that has been heard of the team, kept in the order of its time, whenever it came."""

from __future__ import annotations

import zlib
from bisect import bisect_right, insort
from dataclasses import dataclass, field
from typing import NamedTuple, TypeAlias

import msgspec
import numpy as np
from numpy.typing import NDArray

from shared.messages import (
    Contact,
    DapInstallation,
    HeightFix,
    LocalPosition,
    Mount,
    OdometryIncrement,
    PositionFix,
    ProximityEvent,
    RssiPeak,
    TrackStart,
)

Floats: TypeAlias = NDArray[np.float64]
Ints: TypeAlias = NDArray[np.int64]

END_OF_TIME_NS = 2**63 - 1
MOST_RESPONDERS = 2048

BLOCK, UNPACKED = 256, 512
"""Messages are packed so many at a time; so many of the newest are not."""

ANYWHERE = LocalPosition(north_m=0.0, east_m=0.0, down_m=0.0, covariance_m2=(1e6, 0.0, 1e6))
"""Where a DAP is put of which it is not known where it stands."""

MEASURING_MOUNTS: frozenset[Mount] = frozenset({"boot", "vehicle"})
"""A foot stands still, and a wheelbase has its length. The others guess how long a step is by how
the body bounces, and know nothing of whose it is.
"""

NORTH, EAST, DOWN, HEADING, PLACE_M2, TURN_RAD2, DOWN_M2 = range(7)
"""Columns of ``Moves.values``."""


class Start(NamedTuple):
    """A unit begins: when, where if it says so, and how well its frame is turned (rad).

    ``is_loose`` doubts its scale. A way that is taken up where it was held to be by then is turned
    by ``turn_rad``, its height known to ``down_sd_m``, and was last tied down at ``tied_ns``.
    """

    time_ns: int
    sequence: int
    heading_sd_rad: float
    position: LocalPosition | None
    is_loose: bool = False
    turn_rad: float = 0.0
    down_sd_m: float | None = None
    tied_ns: int | None = None


class Peak(NamedTuple):
    """A pass of a DAP, or of another responder."""

    time_ns: int
    other_id: str
    peak_dbm: float


class Fix(NamedTuple):
    """Somebody's word for where a responder is."""

    time_ns: int
    source: str
    position: LocalPosition


class Height(NamedTuple):
    """Somebody's word for how high a responder or a DAP is: m down, give or take."""

    time_ns: int
    down_m: float
    sd_m: float


class Installed(NamedTuple):
    """A DAP set down: when, by whom, or where.

    ``said_ns`` is the time that it gave itself, where another is supposed. It may have been
    ``found`` there by those who passed it. With nobody and nowhere it was taken up.
    """

    time_ns: int
    installer_id: str | None
    position: LocalPosition | None
    said_ns: int | None = None
    found: bool = False

    @property
    def is_taken_up(self) -> bool:
        """Whether it stands nowhere from then on, until it is set down again."""
        return self.installer_id is None and self.position is None


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

    def add(self, increment: OdometryIncrement) -> bool:
        """Take it in; ``False`` if it was here before."""
        if self._count == len(self._times):
            self._times = np.concatenate([self._times, np.empty_like(self._times)])
            self._values = np.concatenate([self._values, np.empty_like(self._values)])
        mark = (increment.event_time_ns, increment.sequence)
        at = self._count
        while at and (int(self._times[at - 1, 0]), int(self._times[at - 1, 2])) > mark:
            at -= 1
        if at and (int(self._times[at - 1, 0]), int(self._times[at - 1, 2])) == mark:
            return False
        for table in (self._times, self._values):
            table[at + 1 : self._count + 1] = table[at : self._count].copy()
        self._insert(at, increment)
        self._times[at] = increment.event_time_ns, increment.start_time_ns, increment.sequence
        nn, ee, dd, hh = (increment.covariance[entry] for entry in (0, 4, 7, 9))
        self._values[at] = (
            increment.d_north_m, increment.d_east_m, increment.d_down_m, increment.heading_rad,
            0.5 * max(nn + ee, 0.0), max(hh, 0.0), max(dd, 0.0),
        )  # fmt: skip
        self._count += 1
        return True

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
        count = int(np.searchsorted(self._times[: self._count, 0], time_ns, side="right"))
        end_ns, start_ns, sequence = self._times[:count].T
        return Moves(end_ns, start_ns, sequence, self._values[:count])

    def messages_until(self, time_ns: int) -> list[OdometryIncrement]:
        """Return the moves that ended by ``time_ns`` as they were told."""
        return self._told_since(0)[: self.until(time_ns).end_ns.size]

    def messages_after(self, time_ns: int) -> list[OdometryIncrement]:
        """Return the moves that ended after ``time_ns`` as they were told."""
        return self._told_since(self.until(time_ns).end_ns.size)

    def later_than(self, time_ns: int) -> MoveLog:
        """Return the log of the moves that ended after ``time_ns``, to be read only."""
        first = self.until(time_ns).end_ns.size
        later = MoveLog()
        later._times = self._times[first : self._count]
        later._values = self._values[first : self._count]
        packed = min((first + self._skipped) // BLOCK, len(self._packed))
        later._packed = self._packed[packed:]
        later._skipped = first + self._skipped - packed * BLOCK
        later._messages = self._messages.copy()
        later._count = self._count - first
        return later

    def forget(self, time_ns: int) -> None:
        """Drop moves that ended by ``time_ns``: as many whole blocks as are packed, the first."""
        blocks = min(self.until(time_ns).end_ns.size // BLOCK, len(self._packed))
        if blocks:
            first = blocks * BLOCK
            self._times = self._times[first : self._count].copy()
            self._values = self._values[first : self._count].copy()
            del self._packed[:blocks]
            self._count -= first

    def after(self, time_ns: int, before: int = 0) -> Moves:
        """Return the moves that ended after ``time_ns``, and as many ``before`` as there are."""
        first = int(np.searchsorted(self._times[: self._count, 0], time_ns, side="right"))
        first = max(first - before, 0)
        end_ns, start_ns, sequence = self._times[first : self._count].T
        return Moves(end_ns, start_ns, sequence, self._values[first : self._count])


def _pack(messages: list[OdometryIncrement]) -> bytes:
    return zlib.compress(msgspec.msgpack.encode(messages), 1)


def _unpack(packed: bytes) -> list[OdometryIncrement]:
    return msgspec.msgpack.decode(zlib.decompress(packed), type=list[OdometryIncrement])


@dataclass
class ResponderLog:
    """What has been heard of one responder.

    ``heard_ns`` is when they last sent anything, ``near_ns`` when a DAP last heard them near.
    """

    starts: list[Start] = field(default_factory=list)
    moves: MoveLog = field(default_factory=MoveLog)
    peaks: list[Peak] = field(default_factory=list)
    nears: list[Peak] = field(default_factory=list)
    contacts: list[Peak] = field(default_factory=list)
    fixes: list[Fix] = field(default_factory=list)
    heights: list[Height] = field(default_factory=list)
    heard_ns: int = 0
    near_ns: int | None = None

    def starts_until(self, time_ns: int) -> list[Start]:
        """Return the starts that count by ``time_ns``: of several with no move between, the last.

        The first move of one who never said to have started makes an unknown start.
        """
        moves = self.moves.until(time_ns)
        said = self.starts[: bisect_right(self.starts, time_ns, key=lambda each: each.time_ns)]
        counting: list[Start] = []
        for start in said:
            last = counting[-1] if counting else None
            if last is None or _moved_between(moves, last.time_ns, start.time_ns):
                counting.append(start)
            else:
                position = start.position or last.position
                counting[-1] = start._replace(position=position, time_ns=last.time_ns)
        if moves.end_ns.size and (not counting or moves.end_ns[0] <= counting[0].time_ns):
            counting.insert(0, Start(int(moves.start_ns[0]), 0, 100.0, None))
        return counting


def _moved_between(moves: Moves, since_ns: int, until_ns: int) -> bool:
    first, last = np.searchsorted(moves.end_ns, [since_ns, until_ns], side="right")
    return bool(last > first)


class TeamLog:
    """The whole team's. Each ``add_…`` says whether what it was given is new."""

    def __init__(self) -> None:
        self.responders: dict[str, ResponderLog] = {}
        self.daps: dict[str, list[Installed]] = {}
        self.dap_heights: dict[str, list[Height]] = {}

    def of(self, responder_id: str) -> ResponderLog:
        """Return a responder's log, begun if need be; one that nobody keeps, if there are too many.

        DAPs name whom they hear, and a false one could name anybody.
        """
        if responder_id not in self.responders and len(self.responders) >= MOST_RESPONDERS:
            return ResponderLog()
        return self.responders.setdefault(responder_id, ResponderLog())

    def add_start(self, responder_id: str, said: TrackStart) -> bool:
        """A unit begins."""
        start = Start(
            said.event_time_ns, said.sequence, said.heading_sd_rad, said.position,
            is_loose=said.mount not in MEASURING_MOUNTS,
        )  # fmt: skip
        starts = self.of(responder_id).starts
        if any(each[:2] == start[:2] for each in starts):
            return False
        insort(starts, start, key=lambda each: each[:2])
        return True

    def add_move(self, responder_id: str, increment: OdometryIncrement) -> bool:
        """A responder moved."""
        return self.of(responder_id).moves.add(increment)

    def add_peak(self, dap_id: str, said: RssiPeak) -> bool:
        """A responder passed a DAP."""
        peak = Peak(said.event_time_ns, dap_id, said.peak_dbm)
        return _insert(self.of(said.responder_id).peaks, peak)

    def add_near(self, dap_id: str, said: ProximityEvent) -> bool:
        """A DAP holds a responder to be near."""
        near = Peak(said.event_time_ns, dap_id, said.rssi_mean_dbm)
        return _insert(self.of(said.responder_id).nears, near)

    def add_contact(self, responder_id: str, said: Contact) -> bool:
        """Two responders met; kept with the one whose id comes first."""
        one, other = sorted((responder_id, said.other_id))
        if one == other:
            return False
        self.of(other)
        return _insert(self.of(one).contacts, Peak(said.event_time_ns, other, said.peak_dbm))

    def add_fix(self, said: PositionFix) -> bool:
        """Somebody says where a responder is."""
        fix = Fix(said.event_time_ns, said.source, said.position)
        fixes = self.of(said.responder_id).fixes
        if fix in fixes:
            return False
        insort(fixes, fix, key=lambda each: each[:2])
        return True

    def add_height(self, said: HeightFix) -> bool:
        """Somebody says how high a responder or a DAP is."""
        height = Height(said.event_time_ns, said.down_m, said.sd_m)
        if said.node == "dap":
            heights = self.dap_heights.setdefault(said.node_id, [])
        else:
            heights = self.of(said.node_id).heights
        if height in heights:
            return False
        insort(heights, height)
        return True

    def add_dap(self, dap_id: str, said: DapInstallation) -> bool:
        """A DAP was set down or taken up. What a place it had been told adds is not news."""
        installs = self.daps.setdefault(dap_id, [])
        if any(each.time_ns == said.event_time_ns for each in installs):
            return False
        installed = Installed(said.event_time_ns, said.installer_id, said.position)
        if installed.is_taken_up and said.at_rest:
            installed = found_by_passes(installed)
        insort(installs, installed, key=_when)
        return True

    def stands(self, dap_id: str) -> bool:
        """Whether a DAP stands, by the newest that it said."""
        return dap_id in self.daps and not self.daps[dap_id][-1].is_taken_up


def found_by_passes(installed: Installed) -> Installed:
    """Return an installation of which it is only known that it stands: passes tell where."""
    return installed._replace(
        installer_id=None, position=ANYWHERE, said_ns=installed.time_ns, found=True
    )


def _when(installed: Installed) -> int:
    return installed.time_ns


def _insert(events: list[Peak], event: Peak) -> bool:
    at = bisect_right(events, event)
    if at and events[at - 1] == event:
        return False
    events.insert(at, event)
    return True
