"""All tracks and the map: each event in, what it changed out."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from types import MappingProxyType

from command_post.fusion.dap_map import DapMap, InstalledDap
from command_post.fusion.interface import Changes, Doubt, WayTold
from command_post.fusion.settings import FusionSettings
from command_post.fusion.track import Estimate, Track, origin
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


class Tracker:
    """Tracks every responder with a particle filter of their own, on one map of DAPs.

    Events are to come in the order of their time; one that comes late is taken as it is. Tracks
    share the DAPs and nothing else: nobody's random numbers depend on anyone else's messages.

    ``counts`` says what had no effect, or had to be guessed: ``unknown_dap`` and
    ``untracked_responder`` (of a proximity), ``contradicted`` (a proximity that no particle
    could explain), ``stale_start``, ``unknown_start`` (an increment of someone without a start),
    ``lost_increment``, ``unplaced``, ``superseded`` and ``taken_up`` (of installations).
    """

    def __init__(self, settings: FusionSettings) -> None:
        self._settings = settings
        self._tracks: dict[str, Track] = {}
        self._daps = DapMap()
        self._changed: dict[str, Estimate] = {}
        self._changed_daps: dict[str, InstalledDap] = {}
        self.counts: Counter[str] = Counter()

    @property
    def daps(self) -> Mapping[str, InstalledDap]:
        """The DAPs that stand, by id."""
        return MappingProxyType(self._daps)

    @property
    def estimates(self) -> dict[str, Estimate]:
        """The newest estimate of every responder, by id."""
        return {responder_id: track.estimate for responder_id, track in self._tracks.items()}

    @property
    def doubts(self) -> tuple[Doubt, ...]:
        """Nothing: the published filter doubts nobody."""
        return ()

    def start(self, responder_id: str, start: TrackStart) -> None:
        """Begin a track, or begin it again, unless the one there began then or later.

        Strides that were heard already and ended after the start belong to the new track.
        """
        before = self._tracks.get(responder_id)
        if before is not None and before.started_ns is not None:
            if start.event_time_ns < before.started_ns:
                self.counts["stale_start"] += 1
            if start.event_time_ns <= before.started_ns:
                return
        position = start.position or self._last_place(before, start.event_time_ns)
        track = Track(responder_id, start, position, start.event_time_ns, self._settings)
        for increment in before.moved_after(start.event_time_ns) if before else ():
            track.move(increment)
        self._tracks[responder_id] = track
        self._changed[responder_id] = track.estimate

    def move(self, responder_id: str, increment: OdometryIncrement) -> None:
        """Move a responder; one who has not started is first put where nobody knows."""
        track = self._tracks.get(responder_id)
        if track is None:
            self.counts["unknown_start"] += 1
            somewhere = origin(self._settings.unknown_start_sd_m)
            track = Track(responder_id, None, somewhere, increment.event_time_ns, self._settings)
            self._tracks[responder_id] = track
        self.counts["lost_increment"] += track.move(increment)
        self._changed[responder_id] = track.estimate

    def near(self, dap_id: str, event: ProximityEvent) -> None:
        """Tie a responder to a DAP.

        ``left`` says only that a stay has ended: it ties nobody.
        """
        if event.phase == "left":
            return
        dap = self._daps.get(dap_id)
        track = self._tracks.get(event.responder_id)
        if dap is None:
            self.counts["unknown_dap"] += 1
        elif track is None:
            self.counts["untracked_responder"] += 1
        elif not track.tie(dap_id, dap.position, event.event_time_ns):
            self.counts["contradicted"] += 1
        else:
            self._changed[event.responder_id] = track.estimate

    def peak(self, dap_id: str, event: RssiPeak) -> None:  # noqa: ARG002
        """Pass over a peak: the published filter uses nearness alone."""
        self.counts["unused_by_published"] += 1

    def contact(self, responder_id: str, event: Contact) -> None:  # noqa: ARG002
        """Pass over a contact, which the published filter does not know."""
        self.counts["unused_by_published"] += 1

    def fix(self, event: PositionFix) -> None:  # noqa: ARG002
        """Pass over a fix, which the published filter does not know."""
        self.counts["unused_by_published"] += 1

    def height_fix(self, event: HeightFix) -> None:  # noqa: ARG002
        """Pass over a height, which the published filter does not know."""
        self.counts["unused_by_published"] += 1

    def install(self, dap_id: str, said: DapInstallation) -> None:
        """Put a DAP on the map; tell where it stands, if it is to be told."""
        outcome = self._daps.install(dap_id, said, self._place_of)
        if outcome in {"unplaced", "superseded", "taken_up"}:
            self.counts[outcome] += 1
        elif outcome == "placed" or said.position is None:
            self._changed_daps[dap_id] = self._daps[dap_id]

    def heard(self, responder_id: str, time_ns: int, beat_s: float | None = None) -> None:
        """Pass over it: the published filter says nothing of who is silent."""

    @property
    def silent_due_ns(self) -> None:
        """Nothing is."""

    def pass_time(self, time_ns: int) -> list[tuple[str, Estimate]]:  # noqa: ARG002
        """Return nothing, for the same reason."""
        return []

    def forget(self, before_ns: int) -> None:
        """Do nothing: no more is kept than where everybody is."""

    def begin_from(self, ways: Mapping[str, WayTold], daps: Mapping[str, InstalledDap]) -> bool:  # noqa: ARG002
        """Return that this is none of this method's: a cloud is more than was told of it."""
        return False

    def take_changes(self) -> Changes:
        """Return what has changed since this was last asked."""
        estimates, self._changed = sorted(self._changed.items()), {}
        daps, self._changed_daps = sorted(self._changed_daps.items()), {}
        return Changes(estimates, daps, [])

    def afterwards(self) -> None:
        """Return nothing: the published filter does not smooth."""

    def _last_place(self, before: Track | None, time_ns: int) -> LocalPosition:
        """Return where one who does not say it starts: where they were held to be, if started."""
        if before is None or before.started_ns is None:
            return origin(self._settings.entrance_sd_m)
        return before.estimate_at(time_ns).position

    def _place_of(self, responder_id: str, time_ns: int) -> LocalPosition | None:
        track = self._tracks.get(responder_id)
        return None if track is None else track.estimate_at(time_ns).position
