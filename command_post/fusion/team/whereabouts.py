"""Where each responder is told to be: by the last solution, the moves since, and how time passes.

What an event changes is told at once, what a tick changes of those who moved with their next move.
"""

from __future__ import annotations

from collections.abc import Mapping

from command_post.fusion.interface import WayTold
from command_post.fusion.team.estimates import Pose, estimate_of, first_pose, pose_of
from command_post.fusion.team.front import Fronts
from command_post.fusion.team.log import TeamLog
from command_post.fusion.team.making import Fresh
from command_post.fusion.team.settings import TeamSettings
from command_post.fusion.team.silences import Silences, least_quiet_ns
from command_post.fusion.team.standing_doubts import StandingDoubts
from command_post.fusion.team.way_since import Ways
from command_post.fusion.track import Estimate
from shared.units import NS_PER_S

MOST_REASON = 200


class Whereabouts:
    """The newest estimate of everybody in ``log``; what is doubted of them is a reason."""

    def __init__(self, log: TeamLog, doubts: StandingDoubts, settings: TeamSettings) -> None:
        self._log = log
        self._doubts = doubts
        self._settings = settings
        self._tick_ns = round(settings.tick_s * NS_PER_S)
        self._quiet_ns = least_quiet_ns(settings)
        self._poses: dict[str, Pose] = {}
        self._fronts = Fronts()
        self._ways = Ways(settings)
        self._storeys_of: dict[str, tuple[float, ...]] = {}
        self._storeys_m: tuple[float, ...] = ()
        self._silences = Silences(settings)
        self._time_ns = 0
        self._changed: dict[str, Estimate] = {}
        self.estimates: dict[str, Estimate] = {}

    @property
    def silent_due_ns(self) -> int | None:
        """When somebody may have to be told of who is silent; ``None`` if nobody."""
        return self._silences.due_ns

    def take_changed(self) -> list[tuple[str, Estimate]]:
        """Return what is to be told since this was last asked, by id."""
        changed, self._changed = sorted(self._changed.items()), {}
        return changed

    def begin_from(self, poses: dict[str, Pose], ways: Mapping[str, WayTold]) -> None:
        """Begin where everybody was told to be."""
        self._poses = poses
        for name, way in ways.items():
            self.estimates[name] = self._estimate(name, way.told.time_ns)
            self._silences.told(name, way.told.time_ns)

    def keep(
        self, fresh: Fresh, ahead_ns: Mapping[str, int], storeys_m: tuple[float, ...] | None
    ) -> None:
        """Have a crew where it was solved to be; of ``storeys_m`` ``None`` says nothing new."""
        self._storeys_m = self._storeys_m if storeys_m is None else storeys_m
        time_ns, log, solved, heights = fresh
        for index, chain in enumerate(solved.assembled.chains):
            name = chain.responder_id
            own_ahead_ns = ahead_ns.get(name, 0)
            self._poses[name] = pose_of(solved, heights, index, own_ahead_ns, self._settings)
            self._storeys_of[name] = self._storeys_m
            self._fronts.keep(solved, index, log.responders[name], time_ns, self._settings)
            estimate = self._estimate(name, max(time_ns, self._told_until_ns(name)))
            self.estimates[name] = estimate
            if chain.ends_unheard or time_ns - int(chain.time_ns[-1]) >= self._tick_ns:
                self._changed[name] = estimate
                self._silences.told(name, estimate.time_ns)
            if chain.ends_unheard:
                self._silences.seen(name, int(chain.time_ns[-1]) - own_ahead_ns)

    def tell(self, responder_id: str, time_ns: int) -> None:
        """Have it told where somebody is, of whose way something was heard that ended then."""
        self._log.responders[responder_id].known.add(time_ns, self._quiet_ns)
        estimate = self._estimate(responder_id, self._told_until_ns(responder_id))
        self.estimates[responder_id] = self._changed[responder_id] = estimate
        self._silences.told(responder_id, estimate.time_ns)

    def heard(self, responder_id: str, time_ns: int, beat_s: float | None) -> int | None:
        """Note that a responder's unit has told all until then, as it does every ``beat_s``.

        Return since when that changes what others told of them; ``None`` if it does not.
        """
        log = self._log.responders.get(responder_id)
        if log is None:
            return None
        since_ns, before_ns = time_ns, log.known.by(time_ns)
        is_news = log.known.add(time_ns, self._quiet_ns)
        if log.beat_s is None and beat_s is not None:
            self._silences.look(responder_id, time_ns)
            # Who beats is silent sooner, and was all the time.
            is_news, since_ns = True, next(log.known.after(0)).begin_ns
            before_ns = since_ns
        log.beat_s = beat_s
        self._silences.heard(responder_id, time_ns)
        # Whoever is heard of within so short a time is where they were known to be.
        return since_ns if is_news and log.heard_ns > before_ns + self._quiet_ns else None

    def pass_time(self, time_ns: int) -> list[tuple[str, Estimate]]:
        """Return where they are, as time passes, of whom nothing is heard: nobody knows."""
        self._time_ns = max(self._time_ns, time_ns)
        told = []
        for at_ns, responder_id in self._silences.due(self._log.responders, time_ns):
            estimate = self.estimates[responder_id] = self._estimate(responder_id, at_ns)
            told.append((responder_id, estimate))
        return told

    def _told_until_ns(self, responder_id: str) -> int:
        """Return for when it was told where they are: what comes late is not to set them back.

        A clock that is ahead is another matter.
        """
        told = self.estimates.get(responder_id)
        return 0 if told is None else min(told.time_ns, self._time_ns)

    def _estimate(self, responder_id: str, now_ns: int) -> Estimate:
        """Return where a responder is by ``now_ns``, with what is doubted of them as a reason."""
        estimate = self._located(responder_id, now_ns)
        doubted = self._doubts.words_of("responder", responder_id)
        if not doubted:
            return estimate
        reason = "; ".join([estimate.reason, *doubted] if estimate.reason else doubted)
        return estimate._replace(reason=reason[:MOST_REASON])

    def _located(self, responder_id: str, now_ns: int) -> Estimate:
        log = self._log.responders[responder_id]
        pose = self._poses.get(responder_id) or first_pose(log, self._settings)
        storeys_m = self._storeys_of.get(responder_id, self._storeys_m)
        since = self._ways.of(responder_id, log.moves, pose.time_ns)
        estimate = estimate_of(pose, since, log, now_ns, storeys_m, self._settings)
        return self._fronts.told(estimate, log, pose.time_ns, responder_id, self._settings)
