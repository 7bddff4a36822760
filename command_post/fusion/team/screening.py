"""Which suspicions a crew of a large team is solved anew for (pure).

Most of what somebody may be suspected of explains nothing of what stands out. That shows at a small
part of the work of those alone whom it is about, the places being where the crew has them.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from command_post.fusion.team.alone import axis_and_lead, own_ties, places_by_others
from command_post.fusion.team.assembly import UNKNOWN_SD_M, Assembled, Noise, assemble
from command_post.fusion.team.log import Installed, TeamLog, found_by_passes
from command_post.fusion.team.marginals import NO_COVARIANCE
from command_post.fusion.team.move_log import Floats
from command_post.fusion.team.settings import TeamSettings
from command_post.fusion.team.solution import NOTHING, begin_from, laid_out
from command_post.fusion.team.solving import UNDECIDED_COST, Solved, solved_from
from command_post.fusion.team.suspicions import Suspicion, SuspicionKind, supposed
from command_post.fusion.team.ties import PlaceId
from shared.maths.angles import wrap_rad

TURNS_RAD = tuple(math.radians(each) for each in (0.0, -120.0, -60.0, 60.0, 120.0, 180.0))
"""By how much the way since a unit began anew may be turned."""

SCREENED: frozenset[SuspicionKind] = frozenset({
    "clock", "renewed", "scale", "misplaced", "swapped"
})  # fmt: skip
"""What is wrong with one responder or two, and with nobody else."""

WORTH_SHARE = 0.5
"""So much of its price a suspicion must gain of those alone whom it is about."""

APART_RAD = 0.25 * math.pi
"""Ways that end turned by no more against each other are one."""


class _Few(NamedTuple):
    """What was heard of some responders alone, and where the others' passes put places.

    ``cost`` is what their ways cost without any suspicion.
    """

    log: TeamLog
    places: dict[PlaceId, Floats]
    cost: float = math.inf


class Screen:
    """A crew ``solved`` of ``log`` at a time, passes and moves as wide as ``noise`` says.

    Those whom a suspicion is about are solved alone, without it and with it.
    """

    def __init__(
        self, log: TeamLog, solved: Solved, time_ns: int, noise: Noise, settings: TeamSettings
    ) -> None:
        self._log = log
        self._solved = solved
        self._time_ns = time_ns
        self._settings = settings
        self._before = solved.solution(time_ns, noise)
        self._few: dict[tuple[str, ...], _Few] = {}

    def turns_worth(self, suspicion: Suspicion, price: float) -> tuple[float, ...]:
        """Return the turns (rad) to be tried with a suspicion, of those of ``TURNS_RAD``.

        Of several that lead to one way it is one. There are none if it is worth no crew's
        solution, and all where that cannot be told.
        """
        few = self._alone(suspicion)
        if few is None:
            return TURNS_RAD
        tried = self._tried(few, suspicion)
        least = min((each.cost for each in tried), default=math.inf)
        if not least <= few.cost - WORTH_SHARE * price:
            return ()
        if suspicion.kind != "renewed":
            return TURNS_RAD
        by_cost = sorted(zip(TURNS_RAD, tried, strict=False), key=lambda each: each[1].cost)
        ends_rad: dict[float, float] = {}
        for turn_rad, way in by_cost:
            end_rad = float(way.pose[-1, 2])
            if way.cost <= least + UNDECIDED_COST and all(
                abs(wrap_rad(end_rad - other_rad)) > APART_RAD for other_rad in ends_rad.values()
            ):
                ends_rad[turn_rad] = end_rad
        return tuple(ends_rad)

    def _alone(self, suspicion: Suspicion) -> _Few | None:
        """Return those whom a suspicion is about, alone; ``None`` if it is not about them only."""
        if suspicion.role != "responder" or suspicion.kind not in SCREENED:
            return None
        ids = tuple(each for each in (suspicion.node_id, suspicion.other_id) if each)
        chains = self._solved.assembled.chains
        indices = [at for at, chain in enumerate(chains) if chain.responder_id in ids]
        if len(indices) < len(ids):
            return None
        if ids not in self._few:
            own = np.concatenate([own_ties(self._solved, index) for index in indices])
            rows = places_by_others(self._solved, own)
            places = dict(zip(self._solved.assembled.places, rows, strict=True))
            few = _Few(_log_of(self._log, ids), places)
            least = min((each.cost for each in self._tried(few, None)), default=math.inf)
            self._few[ids] = few._replace(cost=least)
        return self._few[ids]

    def _tried(self, few: _Few, suspicion: Suspicion | None) -> list[Solved]:
        """Return some alone: of a way that is turned by each turn; of two from nothing as well."""
        log = few.log if suspicion is None else supposed(few.log, [suspicion])
        belief, settings, before = self._solved.belief, self._settings, self._before
        assembled = assemble(log, self._time_ns, belief, before.noise, settings)
        if assembled is None:
            return []
        assembled = self._among_others(assembled, few.places)
        starts = [begin_from(before, assembled)]
        if suspicion is not None and suspicion.kind == "renewed":
            ((pose, arrow),) = starts
            turned = starts_turned(assembled, pose, suspicion, TURNS_RAD)
            starts = [(each, arrow.copy()) for each in turned] or starts
        elif suspicion is not None and suspicion.kind == "swapped":
            starts.append(begin_from(NOTHING, assembled))
        return [
            solved_from(
                assembled, pose, arrow, belief, settings, settings.commit_iterations,
                NO_COVARIANCE,
            )
            for pose, arrow in starts
        ]  # fmt: skip

    def _among_others(self, assembled: Assembled, places: dict[PlaceId, Floats]) -> Assembled:
        """Return the same, places and axis as well known as the crew's solution tells them."""
        place = assembled.graph.place.copy()
        for row, name in enumerate(assembled.places):
            if place[row, 2] >= UNKNOWN_SD_M and name in places:
                place[row] = places[name]
        axis, lead = axis_and_lead(self._solved)
        assembled.graph = assembled.graph._replace(place=place, axis=axis, lead=lead)
        return assembled


def starts_turned(
    assembled: Assembled, pose: Floats, suspicion: Suspicion, turns_rad: tuple[float, ...]
) -> Iterator[Floats]:
    """Yield poses to start from, one responder's way since their unit changed turned by each turn.

    None if nothing is known of them since.
    """
    index = next(
        at for at, chain in enumerate(assembled.chains) if chain.responder_id == suspicion.node_id
    )
    chain, nodes = assembled.chains[index], assembled.nodes[index]
    first, end = assembled.graph.first[index : index + 2].tolist()
    link = first + int((chain.time_ns[nodes] < suspicion.since_ns).sum())
    if link >= end:
        return
    way_m = chain.way_m[nodes[link - first :]] - chain.way_m[nodes[link - first]]
    for turn_rad in turns_rad:
        turned = pose.copy()
        turned[link:end] = laid_out(pose[link - 1], turn_rad, way_m)
        yield turned


def _log_of(log: TeamLog, ids: tuple[str, ...]) -> TeamLog:
    """Return what was heard of some, DAPs that others set down being where passes put them."""

    def told(installed: Installed) -> Installed:
        if installed.position is not None or installed.installer_id in (None, *ids):
            return installed
        return found_by_passes(installed)

    own = TeamLog()
    own.responders = {each: log.responders[each] for each in ids}
    own.daps = {dap_id: [told(each) for each in installs] for dap_id, installs in log.daps.items()}
    own.dap_heights = log.dap_heights
    return own
