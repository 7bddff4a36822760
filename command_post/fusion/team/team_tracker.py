"""Everybody's track and the map together: each event in, what it changed out.

The same calls as the published ``Tracker``. What is held at any moment is a function of the events
up to then, in the order of their time: solutions are committed at whole multiples of
``commit_s`` of event time, each from the one before, and an event that comes late drops those after
it, which are then made again. So the order of arrival leaves no trace, to the bit.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections import Counter
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from command_post.fusion.dap_map import InstalledDap
from command_post.fusion.interface import Afterwards, Changes, SmoothedTrack
from command_post.fusion.team.arithmetic import sine_cosine
from command_post.fusion.team.assembly import PlaceId
from command_post.fusion.team.elimination import EVERY_NODE
from command_post.fusion.team.log import DOWN, DOWN_M2, EAST, HEADING, NORTH, Floats, TeamLog
from command_post.fusion.team.settings import TeamSettings
from command_post.fusion.team.smoother import smooth
from command_post.fusion.team.solution import NOTHING, Solution
from command_post.fusion.team.solving import Solved, commit, solve
from command_post.fusion.track import MOST_COORDINATE_M, MOST_COVARIANCE_M2, Estimate
from shared.maths.angles import wrap_rad
from shared.messages import (
    Contact,
    DapInstallation,
    HeightFix,
    LocalPosition,
    OdometryIncrement,
    PositionFix,
    ProximityEvent,
    RssiPeak,
    TrackStart,
)
from shared.units import NS_PER_S

COMMITS_KEPT = 720
MOVED_DAP_M = 0.25
END_OF_TIME_NS = 2**63 - 1


class _Pose(NamedTuple):
    """A responder as the last tick had them: where, how their frame is turned, and how surely."""

    time_ns: int
    north_m: float
    east_m: float
    turn_rad: float
    scale: float
    covariance: tuple[float, float, float, float, float, float]


class TeamTracker:
    """Tracks all responders and the DAPs with the team's smoother.

    ``counts`` says what had no effect, or came late: ``late_fused`` (events put where they belong
    in time), ``repeated_event``, ``unplaced`` (installations nobody can place), ``unsolved`` (ticks
    whose equations had no solution).
    """

    def __init__(self, settings: TeamSettings) -> None:
        self._settings = settings
        self._tick_ns = round(settings.tick_s * NS_PER_S)
        self._commit_ns = round(settings.commit_s * NS_PER_S)
        self._log = TeamLog()
        self._slots: list[int] = []
        self._commits: list[Solution] = []
        self._solved_ns = -1
        self._solved: Solved | None = None
        self._poses: dict[str, _Pose] = {}
        self._estimates: dict[str, Estimate] = {}
        self._daps: dict[str, InstalledDap] = {}
        self._changed_daps: dict[str, InstalledDap] = {}
        self._changed: dict[str, Estimate] = {}
        self._last_proximity_ns: dict[str, int] = {}
        self.counts: Counter[str] = Counter()

    @property
    def daps(self) -> Mapping[str, InstalledDap]:
        """The DAPs that stand, by id, as the last tick had them."""
        return MappingProxyType(self._daps)

    @property
    def estimates(self) -> Mapping[str, Estimate]:
        """The newest estimate of every responder, by id."""
        return MappingProxyType(self._estimates)

    def start(self, responder_id: str, start: TrackStart) -> None:
        """Begin a track, or go on with it from a new unit."""
        if self._take(start.event_time_ns, lambda: self._log.add_start(responder_id, start)):
            self._tell(responder_id)

    def move(self, responder_id: str, increment: OdometryIncrement) -> None:
        """Move a responder; one who never started begins where nobody knows."""
        time_ns = increment.event_time_ns
        if self._take(time_ns, lambda: self._log.add_move(responder_id, increment)):
            self._tell(responder_id)

    def near(self, dap_id: str, event: ProximityEvent) -> None:
        """Note that a DAP holds somebody to be near: used where it tells no peaks."""
        if event.phase != "left":
            self._heard_near(event.responder_id, event.event_time_ns)
            self._take(event.event_time_ns, lambda: self._log.add_near(dap_id, event))

    def peak(self, dap_id: str, event: RssiPeak) -> None:
        """Tie a responder to a DAP at the moment when they passed it."""
        self._heard_near(event.responder_id, event.event_time_ns)
        self._take(event.event_time_ns, lambda: self._log.add_peak(dap_id, event))

    def contact(self, responder_id: str, event: Contact) -> None:
        """Tie two responders to each other at the moment when they met."""
        self._take(event.event_time_ns, lambda: self._log.add_contact(responder_id, event))

    def fix(self, event: PositionFix) -> None:
        """Tie a responder to where somebody says they are."""
        self._take(event.event_time_ns, lambda: self._log.add_fix(event))

    def install(self, dap_id: str, said: DapInstallation) -> None:
        """Put a DAP on the map; where it stands is told by the ticks that follow."""
        if said.position is None and said.installer_id is None:
            self.counts["unplaced"] += 1
            return
        new = self._take(said.event_time_ns, lambda: self._log.add_dap(dap_id, said))
        standing = self._daps.get(dap_id)
        if not new and said.position is None and standing is not None:
            # It asks again: the answer may have been lost.
            self._changed_daps[dap_id] = standing

    def height_fix(self, event: HeightFix) -> None:
        """Take in how high somebody says a responder or a DAP is."""

    def take_changes(self) -> Changes:
        """Return what events and ticks have changed since this was last asked."""
        estimates, self._changed = sorted(self._changed.items()), {}
        daps, self._changed_daps = sorted(self._changed_daps.items()), {}
        return Changes(estimates, daps)

    def afterwards(self) -> Afterwards:
        """Return everybody's way with all that is known by now."""
        latest = self._latest_ns()
        if latest is None:
            return Afterwards({}, {})
        self._catch_up(latest)
        before = self._commits[-1] if self._commits else NOTHING
        solved = commit(self._log, latest, before, self._settings)
        if solved is None or not solved.is_sound:
            return Afterwards({}, {})
        self._keep_daps(solved)
        return Afterwards(_smoothed(solved, self._settings), dict(self._daps))

    def _latest_ns(self) -> int | None:
        times = [
            int(moves.end_ns[-1])
            for log in self._log.responders.values()
            if (moves := log.moves.until(END_OF_TIME_NS)).end_ns.size
        ] + [log.starts[-1].time_ns for log in self._log.responders.values() if log.starts]
        return max(times, default=None)

    def _heard_near(self, responder_id: str, time_ns: int) -> None:
        last = self._last_proximity_ns.get(responder_id, 0)
        self._last_proximity_ns[responder_id] = max(last, time_ns)

    def _take(self, time_ns: int, add: Callable[[], bool]) -> bool:
        """Log an event, having solved what ended before it; ``False`` if it was here before."""
        self._tick(time_ns)
        if not add():
            self.counts["repeated_event"] += 1
            return False
        slot = time_ns // self._commit_ns
        at = bisect_left(self._slots, slot)
        if self._slots[at : at + 1] != [slot]:
            self._slots.insert(at, slot)
        if time_ns <= self._solved_ns:
            self.counts["late_fused"] += 1
            while self._commits and self._commits[-1].time_ns >= time_ns:
                self._commits.pop()
        return True

    def _tell(self, responder_id: str) -> None:
        estimate = self._estimate(responder_id)
        self._estimates[responder_id] = estimate
        self._changed[responder_id] = estimate

    def _tick(self, time_ns: int) -> None:
        """Solve the team at the last tick before ``time_ns``, unless that is done."""
        due_ns = (time_ns - 1) // self._tick_ns * self._tick_ns
        if due_ns <= self._solved_ns:
            return
        if not self._log.responders:
            return
        self._catch_up(due_ns)
        before = self._commits[-1] if self._commits else NOTHING
        settings = self._settings
        solved = solve(self._log, due_ns, before, before.belief, settings, settings.tick_iterations)
        self._solved_ns = due_ns
        if solved is not None:
            self.counts["unsolved"] += not solved.is_sound
            if solved.is_sound:
                self._keep(due_ns, solved)

    def _catch_up(self, until_ns: int) -> None:
        """Make the commits that are missing before ``until_ns``, one for each time of events."""
        done_ns = self._commits[-1].time_ns if self._commits else -1
        for slot in self._slots[bisect_left(self._slots, done_ns // self._commit_ns) :]:
            time_ns = (slot + 1) * self._commit_ns
            if time_ns > until_ns:
                break
            if time_ns > done_ns:
                before = self._commits[-1] if self._commits else NOTHING
                solved = commit(self._log, time_ns, before, self._settings)
                if solved is not None and solved.is_sound:
                    self._commits.append(solved.solution(time_ns))
        del self._commits[:-COMMITS_KEPT]

    def _keep(self, time_ns: int, solved: Solved) -> None:
        self._solved = solved
        for index, chain in enumerate(solved.assembled.chains):
            last = int(solved.assembled.graph.first[index + 1]) - 1
            scale = solved.assembled.unit_first[index] + int(chain.unit[-1])
            north_m, east_m, turn_rad = solved.pose[last].tolist()
            nn, ne, ee, tt, nt, et = solved.ends[index].tolist()
            self._poses[chain.responder_id] = _Pose(
                int(chain.time_ns[-1]), north_m, east_m, turn_rad,
                float(solved.arrow[1 + 2 * scale]), (nn, ne, ee, tt, nt, et),
            )  # fmt: skip
            estimate = self._estimate(chain.responder_id, at_least_ns=time_ns)
            self._estimates[chain.responder_id] = estimate
            if time_ns - int(chain.time_ns[-1]) >= self._tick_ns:
                self._changed[chain.responder_id] = estimate
        self._keep_daps(solved)

    def _keep_daps(self, solved: Solved) -> None:
        newest: dict[str, tuple[int, int, PlaceId]] = {}
        for place, place_id in enumerate(solved.assembled.places):
            if place_id[0] == "dap":
                newest[place_id[1]] = (int(place_id[2]), place, place_id)
        for dap_id, (installed_ns, place, _) in newest.items():
            column = solved.assembled.place_column(place)
            cov = solved.shared[column : column + 2, column : column + 2]
            north_m, east_m = solved.arrow[column : column + 2].tolist()
            installed = next(
                each for each in self._log.daps[dap_id] if each.time_ns == installed_ns
            )
            position = LocalPosition(
                north_m=_within(north_m, MOST_COORDINATE_M),
                east_m=_within(east_m, MOST_COORDINATE_M),
                down_m=self._down_of(installed.installer_id, installed.position, installed_ns),
                covariance_m2=(float(cov[0, 0]), float(cov[0, 1]), float(cov[1, 1])),
            )
            dap = InstalledDap(position, installed_ns, installed.installer_id)
            before = self._daps.get(dap_id)
            if (
                before is None
                or _apart_m(before.position, position) > MOVED_DAP_M
                or (before.installed_ns != installed_ns)
            ):
                self._daps[dap_id] = dap
                self._changed_daps[dap_id] = dap

    def _down_of(
        self, installer_id: str | None, position: LocalPosition | None, time_ns: int
    ) -> float:
        log = self._log.responders.get(installer_id or "")
        if log is None:
            return 0.0 if position is None else position.down_m
        return self._start_down(installer_id or "") + float(
            log.moves.until(time_ns).values[:, DOWN].sum()
        )

    def _start_down(self, responder_id: str) -> float:
        for start in self._log.responders[responder_id].starts:
            if start.position is not None:
                return start.position.down_m
        return 0.0

    def _estimate(self, responder_id: str, at_least_ns: int = 0) -> Estimate:
        """Return where a responder is now: the last tick's pose, and the moves since."""
        pose = self._poses.get(responder_id)
        log = self._log.responders[responder_id]
        if pose is None:
            pose = self._first_pose(responder_id)
        since = log.moves.after(pose.time_ns)
        way = since.values[:, [NORTH, EAST]].sum(axis=0) * (1.0 + pose.scale)
        sine, cosine = sine_cosine(pose.turn_rad)
        dn = float(cosine * way[0] - sine * way[1])
        de = float(sine * way[0] + cosine * way[1])
        nn, ne, ee, tt, nt, et = pose.covariance
        count = since.end_ns.size
        stride_m = float(np.abs(since.values[:, [NORTH, EAST]]).sum())
        own_m2 = (
            count * self._settings.stride_sd_m**2 + (self._settings.stride_sd_share * stride_m) ** 2
        )
        factor = self._settings.covariance_factor
        every = log.moves.until(END_OF_TIME_NS)
        tt = min(max(tt, 0.0), math.pi**2 / 3.0)
        down_m = self._start_down(responder_id) + float(every.values[:, DOWN].sum())
        heading = float(every.values[-1, HEADING]) if every.end_ns.size else 0.0
        time_ns = int(since.end_ns[-1]) if count else max(pose.time_ns, at_least_ns)
        return Estimate(
            time_ns=time_ns,
            north_m=_within(pose.north_m + dn, MOST_COORDINATE_M),
            east_m=_within(pose.east_m + de, MOST_COORDINATE_M),
            down_m=_within(down_m, MOST_COORDINATE_M),
            covariance_m2=(
                _within(factor * (nn - 2.0 * de * nt + de * de * tt + own_m2), MOST_COVARIANCE_M2),
                _within(factor * (ne + dn * nt - de * et - dn * de * tt), MOST_COVARIANCE_M2),
                _within(factor * (ee + 2.0 * dn * et + dn * dn * tt + own_m2), MOST_COVARIANCE_M2),
            ),
            heading_rad=wrap_rad(heading + pose.turn_rad),
            heading_sd_rad=math.sqrt(tt),
            last_proximity_time_ns=self._last_proximity_ns.get(responder_id),
            down_sd_m=math.sqrt(max(float(every.values[:, DOWN_M2].sum()), 0.0)),
        )

    def _first_pose(self, responder_id: str) -> _Pose:
        """Return where one is put of whom there is no solution yet."""
        starts = self._log.responders[responder_id].starts_until(END_OF_TIME_NS)
        start = starts[-1]
        place = next((each.position for each in reversed(starts) if each.position), None)
        north_m, east_m = (place.north_m, place.east_m) if place else (0.0, 0.0)
        sd_m = self._settings.start_sd_m if place else self._settings.entrance_sd_m
        tt = min(start.heading_sd_rad, math.pi) ** 2
        return _Pose(
            start.time_ns, north_m, east_m, 0.0, 0.0, (sd_m**2, 0.0, sd_m**2, tt, 0.0, 0.0)
        )


def _smoothed(solved: Solved, settings: TeamSettings) -> dict[str, SmoothedTrack]:
    """Return the ways of a solution, stance by stance, with covariances."""
    graph, pose, arrow = solved.assembled.graph, solved.pose.copy(), solved.arrow.copy()
    _, _, covariance, _ = smooth(
        graph, pose, arrow, settings.commit_iterations, settings.settled_m, EVERY_NODE
    )
    tracks = {}
    for index, chain in enumerate(solved.assembled.chains):
        nodes = solved.assembled.nodes[index]
        first = int(graph.first[index])
        of_chain = pose[first : first + len(nodes)]
        scale = arrow[1 + 2 * (solved.assembled.unit_first[index] + chain.unit)]
        stance = np.arange(chain.time_ns.size)
        before = np.maximum(np.searchsorted(nodes, stance, side="left") - 1, 0)
        after = np.minimum(before + 1, len(nodes) - 1)
        one, other = nodes[before], nodes[after]
        turn = 0.5 * (of_chain[before, 2] + of_chain[after, 2])
        place = of_chain[before, :2] + _turn_all(turn, scale, chain.way_m - chain.way_m[one])
        there = of_chain[before, :2] + _turn_all(turn, scale, chain.way_m[other] - chain.way_m[one])
        share = ((stance - one) / np.maximum(other - one, 1))[:, None]
        place += share * (of_chain[after, :2] - there)
        of_node = covariance[first : first + len(nodes), :3]
        spread = (1.0 - share) * of_node[before] + share * of_node[after]
        down = np.zeros(len(stance))
        tracks[chain.responder_id] = SmoothedTrack(
            chain.time_ns / NS_PER_S,
            np.column_stack([place, down]),
            spread * settings.covariance_factor,
        )
    return tracks


def _turn_all(turn_rad: Floats, scale: Floats, way_m: Floats) -> Floats:
    turned = [sine_cosine(turn) for turn in turn_rad.tolist()]
    sine, cosine = np.array(turned).T
    north, east = way_m.T * (1.0 + scale)
    return np.column_stack([cosine * north - sine * east, sine * north + cosine * east])


def _apart_m(one: LocalPosition, other: LocalPosition) -> float:
    return math.hypot(one.north_m - other.north_m, one.east_m - other.east_m)


def _within(value: float, bound: float) -> float:
    return min(max(value, -bound), bound)
