"""Which suspicions a crew of a large team is solved anew for, told by the responder alone (pure).

Most of what somebody may be suspected of explains nothing of what stands out. Alone, the places
being where the crew has them, that shows at a small part of the work.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

from command_post.fusion.team.alone import axis_and_lead, own_ties, places_by_others
from command_post.fusion.team.assembly import UNKNOWN_SD_M, Assembled, Noise, assemble
from command_post.fusion.team.log import Installed, TeamLog, found_by_passes
from command_post.fusion.team.marginals import NO_COVARIANCE
from command_post.fusion.team.move_log import Floats
from command_post.fusion.team.settings import TeamSettings
from command_post.fusion.team.solution import begin_from, laid_out
from command_post.fusion.team.solving import UNDECIDED_COST, Solved, solved_from
from command_post.fusion.team.suspicions import Suspicion, SuspicionKind, supposed
from shared.maths.angles import wrap_rad

TURNS_RAD = tuple(math.radians(each) for each in (0.0, -120.0, -60.0, 60.0, 120.0, 180.0))
"""By how much the way since a unit began anew may be turned."""

SCREENED: frozenset[SuspicionKind] = frozenset({"clock", "renewed", "scale", "misplaced"})
"""What is wrong with one responder, and with nobody else."""

WORTH_SHARE = 0.5
"""So much of its price a suspicion must gain of the responder alone."""


APART_RAD = 0.25 * math.pi
"""Ways that end turned by no more against each other are one."""


class Screen:
    """A crew's responder by the crew's solution: alone, without any suspicion and with each."""

    def __init__(
        self, log: TeamLog, solved: Solved, chain: int, time_ns: int, noise: Noise,
        settings: TeamSettings,
    ) -> None:  # fmt: skip
        """``solved`` is of ``log`` at ``time_ns``, passes and moves as wide as ``noise`` says."""
        self._solved = solved
        self._responder_id = solved.assembled.chains[chain].responder_id
        self._log = _log_of(log, self._responder_id)
        self._time_ns = time_ns
        self._noise = noise
        self._settings = settings
        self._before = solved.solution(time_ns, noise)
        rows = places_by_others(solved, own_ties(solved, chain))
        self._places = dict(zip(solved.assembled.places, rows, strict=True))
        self._without: float | None = None

    def turns_worth(self, suspicion: Suspicion, price: float) -> tuple[float, ...]:
        """Return the turns (rad) to be tried with a suspicion, of those of ``TURNS_RAD``.

        Of several that lead to one way it is one. There are none if it is worth no crew's
        solution, and all of what is not told by one alone.
        """
        if suspicion.role != "responder" or suspicion.kind not in SCREENED:
            return TURNS_RAD
        if self._without is None:
            self._without = min(each.cost for each in self._tried(None))
        tried = self._tried(suspicion)
        least = min((each.cost for each in tried), default=math.inf)
        if not least <= self._without - WORTH_SHARE * price:
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

    def _tried(self, suspicion: Suspicion | None) -> list[Solved]:
        """Return the responder's way alone, of one that is turned by each turn."""
        log = self._log if suspicion is None else supposed(self._log, [suspicion])
        belief, settings = self._solved.belief, self._settings
        assembled = assemble(log, self._time_ns, belief, self._noise, settings)
        if assembled is None:
            return []
        assembled = self._among_others(assembled)
        pose, arrow = begin_from(self._before, assembled)
        starts = [pose]
        if suspicion is not None and suspicion.kind == "renewed":
            starts = [*starts_turned(assembled, pose, suspicion, TURNS_RAD)] or starts
        return [
            solved_from(
                assembled, start, arrow.copy(), belief, settings, settings.commit_iterations,
                NO_COVARIANCE,
            )
            for start in starts
        ]  # fmt: skip

    def _among_others(self, assembled: Assembled) -> Assembled:
        """Return the same, places and axis as well known as the crew's solution tells them."""
        place = assembled.graph.place.copy()
        for row, name in enumerate(assembled.places):
            if place[row, 2] >= UNKNOWN_SD_M and name in self._places:
                place[row] = self._places[name]
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


def _log_of(log: TeamLog, responder_id: str) -> TeamLog:
    """Return what was heard of one, DAPs that others set down being where passes put them."""

    def told(installed: Installed) -> Installed:
        if installed.position is not None or installed.installer_id in (None, responder_id):
            return installed
        return found_by_passes(installed)

    own = TeamLog()
    own.responders = {responder_id: log.responders[responder_id]}
    own.daps = {dap_id: [told(each) for each in installs] for dap_id, installs in log.daps.items()}
    own.dap_heights = log.dap_heights
    return own
