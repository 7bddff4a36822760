"""Everybody's track and the map together: each event in, what it changed out.

The same calls as the published ``Tracker``. What is held at any moment is a function of the events
up to then, in the order of their time: solutions are committed at whole multiples of
``commit_s`` of event time, each from the one before, and an event that comes late drops those after
it, which are then made again. So the order of arrival leaves no trace, to the bit.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping
from types import MappingProxyType

from command_post.fusion.dap_map import InstalledDap
from command_post.fusion.interface import Afterwards, Changes, Doubt, SmoothedTrack, WayTold
from command_post.fusion.team.agenda import Agenda
from command_post.fusion.team.anchors import cut, with_past
from command_post.fusion.team.begun import begin
from command_post.fusion.team.commits import Commits
from command_post.fusion.team.crews import Bonds, Crew
from command_post.fusion.team.dap_places import apart_m, daps_of
from command_post.fusion.team.doubt_words import doubts_of
from command_post.fusion.team.forgetting import forget
from command_post.fusion.team.height_assembly import solve_heights
from command_post.fusion.team.lines import Lines
from command_post.fusion.team.log import END_OF_TIME_NS, TeamLog
from command_post.fusion.team.making import Fresh
from command_post.fusion.team.quarters import with_all_ways
from command_post.fusion.team.settings import TeamSettings
from command_post.fusion.team.smoothed import smoothed_tracks
from command_post.fusion.team.solution import NOTHING, Solution, concerning
from command_post.fusion.team.solving import commit, solve
from command_post.fusion.team.standing_doubts import StandingDoubts
from command_post.fusion.team.suspicions import clocks_ahead_ns, supposed
from command_post.fusion.team.whereabouts import Whereabouts
from command_post.fusion.track import Estimate
from shared.messages import (
    Contact,
    DapInstallation,
    HeightFix,
    OdometryIncrement,
    PositionFix,
    ProximityEvent,
    RssiPeak,
    TrackStart,
)

MOVED_DAP_M = 0.25


class TeamTracker:
    """Tracks all responders and the DAPs with the team's smoother.

    ``counts`` says what had no effect, or came late: ``late_fused`` (events put where they belong
    in time), ``repeated_event``, ``unsolved`` (ticks whose equations had no solution),
    ``too_many_responders``.
    """

    def __init__(self, settings: TeamSettings) -> None:
        self._settings = settings
        self._log = TeamLog()
        self._bonds = Bonds()
        self._lines = Lines(self._log, self._bonds, settings)
        self._agenda = Agenda(self._lines, settings)
        self._solved_ns = -1
        self._doubts = StandingDoubts()
        self._whereabouts = Whereabouts(self._log, self._doubts, settings)
        self._daps: dict[str, InstalledDap] = {}
        self._told_daps: dict[str, InstalledDap] = {}
        self._changed_daps: dict[str, InstalledDap] = {}
        self._is_whole = True
        """Whether nothing was forgotten."""

        self.counts: Counter[str] = Counter()

    @property
    def _commits(self) -> Commits:
        return self._lines.live

    @property
    def daps(self) -> Mapping[str, InstalledDap]:
        """The DAPs that stand, by id, as the last tick had them."""
        return MappingProxyType(self._daps)

    @property
    def estimates(self) -> Mapping[str, Estimate]:
        """The newest estimate of every responder, by id."""
        return MappingProxyType(self._whereabouts.estimates)

    @property
    def doubts(self) -> tuple[Doubt, ...]:
        """What is held to be wrong with nodes, as of the last tick."""
        return self._doubts.told

    def start(self, responder_id: str, start: TrackStart) -> None:
        """Begin a track, or go on with it from a new unit."""
        if self._take_own(
            responder_id, start.event_time_ns, lambda: self._log.add_start(responder_id, start)
        ):
            self._tell(responder_id, start.event_time_ns)

    def move(self, responder_id: str, increment: OdometryIncrement) -> None:
        """Move a responder; one who never started begins where nobody knows."""
        time_ns = increment.event_time_ns
        if self._take_own(
            responder_id, time_ns, lambda: self._log.add_move(responder_id, increment)
        ):
            self._tell(responder_id, time_ns)

    def near(self, dap_id: str, event: ProximityEvent) -> None:
        """Note that a DAP holds somebody to be near: used where it tells no peaks."""
        if event.phase != "left":
            self._heard_near(event.responder_id, event.event_time_ns)
            self._take(
                event.event_time_ns, event.responder_id,
                lambda: self._log.add_near(dap_id, event),
                lambda: self._bonds.note_passed(event.responder_id, dap_id, event.event_time_ns),
            )  # fmt: skip

    def peak(self, dap_id: str, event: RssiPeak) -> None:
        """Tie a responder to a DAP at the moment when they passed it."""
        self._heard_near(event.responder_id, event.event_time_ns)
        self._take(
            event.event_time_ns, event.responder_id, lambda: self._log.add_peak(dap_id, event),
            lambda: self._note_peak(dap_id, event),
        )  # fmt: skip

    def contact(self, responder_id: str, event: Contact) -> None:
        """Tie two responders to each other at the moment when they met."""
        self._take(
            event.event_time_ns, responder_id,
            lambda: self._log.add_contact(responder_id, event),
            lambda: self._bonds.note_met(responder_id, event.other_id, event.event_time_ns),
        )  # fmt: skip

    def fix(self, event: PositionFix) -> None:
        """Tie a responder to where somebody says they are."""
        self._take(event.event_time_ns, event.responder_id, lambda: self._log.add_fix(event))

    def install(self, dap_id: str, said: DapInstallation) -> None:
        """Put a DAP on the map, or take it off; where it stands is told by the ticks to come."""
        new = self._take(
            said.event_time_ns, dap_id, lambda: self._log.add_dap(dap_id, said), lambda: True,
            of_dap=True,
        )  # fmt: skip
        if not self._log.stands(dap_id):
            self._daps = {name: dap for name, dap in self._daps.items() if name != dap_id}
            self._told_daps.pop(dap_id, None)
        standing = self._daps.get(dap_id)
        if not new and said.position is None and standing is not None:
            # It asks again: the answer may have been lost.
            self._changed_daps[dap_id] = standing

    def height_fix(self, event: HeightFix) -> None:
        """Take in how high somebody says a responder or a DAP is."""
        self._take(
            event.event_time_ns, event.node_id, lambda: self._log.add_height(event),
            of_dap=event.node == "dap",
        )  # fmt: skip

    def heard(self, responder_id: str, time_ns: int, beat_s: float | None = None) -> None:
        """Note that a responder's unit has told all until then."""
        changed_ns = self._whereabouts.heard(responder_id, time_ns, beat_s)
        if changed_ns is not None and self._is_solved(changed_ns):
            self._begin_again(changed_ns, frozenset({responder_id}), bonds=False)

    @property
    def silent_due_ns(self) -> int | None:
        """When somebody may have to be told of who is silent; ``None`` if nobody."""
        return self._whereabouts.silent_due_ns

    def pass_time(self, time_ns: int) -> list[tuple[str, Estimate]]:
        """Return where they are, as time passes, of whom nothing is heard: nobody knows."""
        return self._whereabouts.pass_time(time_ns)

    def forget(self, before_ns: int) -> None:
        """Drop what is of no use if nothing comes any more that happened before ``before_ns``.

        What is estimated is the same to the bit, live. Afterwards ways begin where they are begun
        from by then.
        """
        found = self._lines.forget_before(before_ns)
        if found is not None:
            anchors, begin_ns = found
            forget(self._log, anchors, begin_ns, self._settings)
            self._is_whole = False

    def begin_from(self, ways: Mapping[str, WayTold], daps: Mapping[str, InstalledDap]) -> bool:
        """Begin where everybody was told to be, in place of all that was heard before."""
        poses = begin(self._log, self._bonds, ways, daps, self._settings)
        self._daps, self._told_daps = dict(daps), dict(daps)
        self._is_whole = False
        for way in ways.values():
            self._lines.note(way.told.time_ns)
        self._whereabouts.begin_from(poses, ways)
        return True

    def take_changes(self) -> Changes:
        """Return what events and ticks have changed since this was last asked."""
        estimates = self._whereabouts.take_changed()
        daps, self._changed_daps = sorted(self._changed_daps.items()), {}
        return Changes(estimates, daps, self._commits.mishaps.take())

    def afterwards(self) -> Afterwards:
        """Return everybody's way with all that is known by now, as far as it was not forgotten."""
        latest = self._latest_ns()
        if latest is None:
            return Afterwards({}, {})
        self._lines.settle(latest)
        tracks: dict[str, SmoothedTrack] = {}
        daps: dict[str, InstalledDap] = {}
        for crew in self._commits.crews(self._commits.number_at(latest)).crews:
            with self._commits.mishaps.survived("solving all afterwards"):
                ways, places = self._smoothed(crew, latest)
                tracks |= ways
                daps |= places
        return Afterwards(
            tracks, {name: dap for name, dap in daps.items() if self._log.stands(name)}
        )

    def _smoothed(
        self, crew: Crew, latest: int
    ) -> tuple[dict[str, SmoothedTrack], dict[str, InstalledDap]]:
        """Return the ways of a crew, and where its DAPs stand, by all that is known."""
        heard = self._commits.log_of(crew, latest)
        before = concerning(self._commits.before(crew, latest), heard)
        if self._is_whole:
            before = with_past(before)
        else:
            heard = cut(heard, before.anchors, latest, self._settings)
        log = supposed(heard, before.suspicions)
        solved = commit(log, latest, before, self._settings)
        if solved is None or not solved.is_sound:
            return {}, {}
        settings = self._settings
        solved = with_all_ways(
            solved, settings, settings.commit_iterations, is_everybody=crew.is_everybody
        )
        heights = solve_heights(log, solved.assembled, latest, self._settings)
        ahead_ns = clocks_ahead_ns(before.suspicions)
        tracks = smoothed_tracks(solved, heights, ahead_ns, self._settings)
        return tracks, self._commits.published(crew, latest, daps_of(log, solved, heights))

    def _latest_ns(self) -> int | None:
        times = [
            int(moves.end_ns[-1])
            for log in self._log.responders.values()
            if (moves := log.moves.until(END_OF_TIME_NS)).end_ns.size
        ] + [log.starts[-1].time_ns for log in self._log.responders.values() if log.starts]
        return max(times, default=None)

    def _heard_near(self, responder_id: str, time_ns: int) -> None:
        log = self._log.of(responder_id)
        log.near_ns = max(log.near_ns or 0, time_ns)

    def _take_own(self, responder_id: str, time_ns: int, add: Callable[[], bool]) -> bool:
        """Log what a responder's own unit says."""

        def bond() -> bool:
            # Of too many nobody keeps a log.
            kept = responder_id in self._log.responders
            return kept and self._bonds.note_began(responder_id, time_ns)

        return self._take(time_ns, responder_id, add, bond)

    def _note_peak(self, dap_id: str, event: RssiPeak) -> bool:
        if event.peak_dbm < self._settings.sharpness.least_dbm:
            self._bonds.note_faint(event.responder_id, dap_id)
            return False
        return self._bonds.note_passed(event.responder_id, dap_id, event.event_time_ns)

    def _take(
        self, time_ns: int, node_id: str, add: Callable[[], bool],
        bond: Callable[[], bool] | None = None, *, of_dap: bool = False,
    ) -> bool:  # fmt: skip
        """Log an event, having solved what ended before it; ``False`` if it was here before.

        ``node_id`` is the responder's whom it concerns, or the DAP's if it is ``of_dap``; ``bond``
        notes whom it ties to whom.
        """
        self._tick(time_ns)
        if not add():
            self.counts["repeated_event"] += 1
            return False
        bonds = bond is not None and bond()
        self._lines.note(time_ns)
        self.counts["late_fused"] += time_ns <= self._solved_ns
        if self._is_solved(time_ns):
            installs = self._log.daps.get(node_id, ()) if of_dap else ()
            who = self._bonds.concerned(node_id, installs) if of_dap else frozenset({node_id})
            self._begin_again(time_ns, who, bonds=bonds)
        return True

    def _is_solved(self, time_ns: int) -> bool:
        return time_ns <= max(self._solved_ns, self._commits.until_ns)

    def _begin_again(self, time_ns: int, who: frozenset[str], *, bonds: bool) -> None:
        """Have made anew what was solved of ``who`` without what is known by now of ``time_ns``."""
        self._lines.forget(time_ns, who, bonds=bonds)
        self._agenda.ask_again()

    def _tell(self, responder_id: str, time_ns: int) -> None:
        if responder_id not in self._log.responders:
            self.counts["too_many_responders"] += 1
            return
        self._whereabouts.tell(responder_id, time_ns)

    def _tick(self, time_ns: int) -> None:
        """Solve each crew at its last tick before ``time_ns``, unless that is done."""
        if self._log.responders:
            for _, due_ns, crew in self._agenda.due_before(time_ns):
                with self._commits.mishaps.survived(f"solving {len(crew.members)} responders"):
                    self._solve(crew, due_ns)

    def _solve(self, crew: Crew, due_ns: int) -> None:
        if self._lines.catch_up(due_ns):
            self._agenda.ask_again()
        self._solved_ns = max(self._solved_ns, due_ns)
        before = self._commits.before(crew, due_ns)
        fresh = None if crew.is_everybody else self._commits.fresh(crew, due_ns)
        if fresh is None:
            fresh = self._solved(crew, due_ns, before)
        if fresh is not None and not fresh.heights.is_sound:
            self.counts["unsolved"] += 1
        elif fresh is not None:
            self._keep(crew, fresh, before)

    def _solved(self, crew: Crew, due_ns: int, before: Solution) -> Fresh | None:
        heard = self._commits.log_of(crew, due_ns)
        before = concerning(before, heard)
        settings = self._settings
        log = supposed(cut(heard, before.anchors, due_ns, settings), before.suspicions)
        solved = solve(log, due_ns, before, before.belief, settings, settings.tick_iterations)
        if solved is None or not solved.is_sound:
            self.counts["unsolved"] += solved is not None
            return None
        solved = with_all_ways(
            solved, settings, settings.tick_iterations, is_everybody=crew.is_everybody
        )
        return Fresh(due_ns, log, solved, solve_heights(log, solved.assembled, due_ns, settings))

    def _keep(self, crew: Crew, fresh: Fresh, before: Solution) -> None:
        time_ns, log, solved, heights = fresh
        if before is not NOTHING:
            self._doubts.keep(crew, doubts_of(before.held))
        storeys_m = None if before is NOTHING else before.storeys_m
        self._whereabouts.keep(fresh, clocks_ahead_ns(before.suspicions), storeys_m)
        self._keep_daps(self._commits.published(crew, time_ns, daps_of(log, solved, heights)))

    def _keep_daps(self, told: Mapping[str, InstalledDap]) -> None:
        daps = {dap_id: dap for dap_id, dap in told.items() if self._log.stands(dap_id)}
        self._daps = {**self._daps, **daps}
        for dap_id, dap in daps.items():
            before = self._told_daps.get(dap_id)
            if (
                before is None
                or before.installed_ns != dap.installed_ns
                or apart_m(before.position, dap.position) > MOVED_DAP_M
            ):
                self._told_daps[dap_id] = self._changed_daps[dap_id] = dap
