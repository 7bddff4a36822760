"""All that has been heard of the team, kept in the order of its time, whenever it came."""

from __future__ import annotations

from bisect import bisect_right, insort
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from command_post.fusion.team.known import Known
from command_post.fusion.team.move_log import MoveLog, Moves
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

END_OF_TIME_NS = 2**63 - 1
MOST_RESPONDERS = 2048

ANYWHERE = LocalPosition(north_m=0.0, east_m=0.0, down_m=0.0, covariance_m2=(1e6, 0.0, 1e6))
"""Where a DAP is put of which it is not known where it stands."""

MEASURING_MOUNTS: frozenset[Mount] = frozenset({"boot", "vehicle"})
"""A foot stands still, and a wheelbase has its length. The others guess how long a step is by how
the body bounces, and know nothing of whose it is.
"""


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


@dataclass
class ResponderLog:
    """What has been heard of one responder.

    By ``known`` it was known where they were: a move had ended, or their unit had told all until
    then, as it does every ``beat_s`` if it beats. ``near_ns`` is when a DAP last heard them near,
    ``heard_ns`` when anybody but their own unit last told of them.
    """

    starts: list[Start] = field(default_factory=list)
    moves: MoveLog = field(default_factory=MoveLog)
    peaks: list[Peak] = field(default_factory=list)
    nears: list[Peak] = field(default_factory=list)
    contacts: list[Peak] = field(default_factory=list)
    fixes: list[Fix] = field(default_factory=list)
    heights: list[Height] = field(default_factory=list)
    known: Known = field(default_factory=Known)
    beat_s: float | None = None
    near_ns: int | None = None
    heard_ns: int = 0

    def hear(self, time_ns: int) -> None:
        """Note that somebody else told of them then."""
        self.heard_ns = max(self.heard_ns, time_ns)

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
        log = self.responders.get(responder_id)
        if log is None:
            log = ResponderLog()
            if len(self.responders) < MOST_RESPONDERS:
                self.responders[responder_id] = log
        return log

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
        log = self.of(said.responder_id)
        log.hear(said.event_time_ns)
        return _insert(log.peaks, Peak(said.event_time_ns, dap_id, said.peak_dbm))

    def add_near(self, dap_id: str, said: ProximityEvent) -> bool:
        """A DAP holds a responder to be near."""
        log = self.of(said.responder_id)
        log.hear(said.event_time_ns)
        return _insert(log.nears, Peak(said.event_time_ns, dap_id, said.rssi_mean_dbm))

    def add_contact(self, responder_id: str, said: Contact) -> bool:
        """Two responders met; kept with the one whose id comes first."""
        one, other = sorted((responder_id, said.other_id))
        if one == other:
            return False
        for who in (one, other):
            self.of(who).hear(said.event_time_ns)
        return _insert(self.of(one).contacts, Peak(said.event_time_ns, other, said.peak_dbm))

    def add_fix(self, said: PositionFix) -> bool:
        """Somebody says where a responder is."""
        fix = Fix(said.event_time_ns, said.source, said.position)
        log = self.of(said.responder_id)
        if fix in log.fixes:
            return False
        log.hear(said.event_time_ns)
        insort(log.fixes, fix, key=lambda each: each[:2])
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
        if installed.installer_id in self.responders:
            self.responders[installed.installer_id].hear(installed.time_ns)
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
