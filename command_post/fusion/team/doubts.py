"""What is wrong with a node, found by what explains the team's passes at the least cost (pure).

After each commit, nodes whose passes stand out are suspected of this and that; the team is solved
as if each suspicion were right, and the one is adopted that makes the solution cheaper by more
than such a thing is unlikely beforehand. It is held while it goes on to explain half of that.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Iterable, Mapping
from itertools import islice
from typing import NamedTuple

from command_post.fusion.team.accusations import Node, against, against_clock, leaning
from command_post.fusion.team.arithmetic import logarithm
from command_post.fusion.team.assembly import Noise, assemble
from command_post.fusion.team.graph import FIRST_UNIT
from command_post.fusion.team.log import ResponderLog, TeamLog
from command_post.fusion.team.misfits import (
    EXPECTED_COST,
    STANDS_OUT,
    Pass,
    by_key,
    passes_of,
    scale_off,
    worst_bend,
    worst_fix,
)
from command_post.fusion.team.same_floor import by_floor
from command_post.fusion.team.screening import TURNS_RAD, Screen, starts_turned
from command_post.fusion.team.settings import TeamSettings
from command_post.fusion.team.solution import NOTHING, Held, Solution, begin_from
from command_post.fusion.team.solving import Solved, solve, solved_from
from command_post.fusion.team.suspicions import Suspicion, SuspicionKind, supposed
from shared.topics import Role
from shared.units import NS_PER_S

PRICE: Mapping[SuspicionKind, float] = {
    "moved": 26.0,
    "astray": 20.0,
    "clock": 22.0,
    "swapped": 22.0,
    "renewed": 34.0,
    "scale": 9.4,
    "misplaced": 18.0,
}
"""How much cheaper a solution must become: twice the logarithm of how unlikely each is, with what
its free parameters could explain by chance. What is known of a scale has a heavy tail, of which
strides a seventh too long cost as much as that of ``scale``."""

KEPT_SHARE = 0.5
BETTER_BY = 6.0
LEAST_MISFIT = 6.0
MOST_SUSPECTS = 2
MOST_TRIED_OF_CROWD = 8
MOST_TRIED_AGAIN = 2
"""Of a crew of a large team one node is suspected at a commit, of no more things than the first
says; what may be instead of what is held is tried by turns, so many at a commit."""

FEWEST_TO_ONE = 4
"""Of so many DAPs one may be doubted: who finds most of them wrong is more likely wrong.

And of so many scales, of nobody's who is alone: were most of them free, nothing would tell how
large the map is, or how blunt radio is here. And of so many who were not where that was said: were
most of them so, it is the DAP that they all passed.
"""

RAISED, HELD, LEANS = "raised/", "held/", "leans/"

LEAST_SCALE_OFF = 0.1
"""By no less are strides too long or short beside others': else all of a map would be smaller."""

TIMES_THE_REST = 3.0
ASTRAY_AREA_M2 = 1500.0
"""Over so much ground are passes spread that mean nothing."""


class Verdict(NamedTuple):
    """The solution with what is held against nodes, and how many passes each was judged by."""

    solved: Solved
    held: tuple[Held, ...]
    examined: Mapping[str, int]


class _Case(NamedTuple):
    """What is judged: all solutions of it under the same noise, so that costs compare.

    ``of_crowd`` is a crew of a large team, for which little time is left.
    """

    log: TeamLog
    time_ns: int
    noise: Noise
    settings: TeamSettings
    of_crowd: bool

    @property
    def suspects(self) -> dict[Role, int]:
        """How many nodes may be suspected now, by role: of a crowd one, the roles by turns."""
        if not self.of_crowd:
            return {"dap": MOST_SUSPECTS, "responder": MOST_SUSPECTS}
        return {"dap": 1} if self.number % 2 else {"responder": 1}

    @property
    def number(self) -> int:
        """Which commit it is."""
        return self.time_ns // round(self.settings.commit_s * NS_PER_S)


def tried_of_crowd(number: int, *, again: bool) -> range:
    """Return which of all suspicions against a node are tried at a commit of a crowd's crew.

    ``again``: beside the one that is held.
    """
    if not again:
        return range(MOST_TRIED_OF_CROWD)
    first = number * MOST_TRIED_AGAIN % MOST_TRIED_OF_CROWD
    return range(first, first + MOST_TRIED_AGAIN)


def examine(
    log: TeamLog, time_ns: int, solved: Solved, before: Solution, settings: TeamSettings,
    *, of_crowd: bool = False,
) -> Verdict:  # fmt: skip
    """Return ``solved``, or the team solved anew with suspicions that explain it better.

    ``solved`` is of ``log`` with what ``before`` held; ``log`` is as it was heard. Of a crew of a
    large team, ``of_crowd``, less is tried at once.
    """
    if not settings.doubts:
        return Verdict(solved, (), {})
    case = _Case(log, time_ns, before.noise, settings, of_crowd)
    verdict = Verdict(solved, before.held, dict(before.examined))
    for held in before.held:
        verdict = _reviewed(case, verdict, held)
    return _suspected(case, verdict)


def _nodes(log: TeamLog, solved: Solved) -> list[Node]:
    """Return all nodes that are passed, or pass any; ``solved`` is of ``log``."""
    passes = passes_of(solved)
    chains = solved.assembled.chains
    of_dap = by_key([each for each in passes if each.place[0] == "dap"], lambda each: each.place[1])
    of_responder = by_key(passes, lambda each: chains[each.chain].responder_id)
    count, cost = len(passes), math.fsum(each.cost for each in passes)
    found = [Node("dap", dap_id, own, _misfit(own, count, cost)) for dap_id, own in of_dap.items()]
    for responder_id, own in of_responder.items():
        misfit = _misfit(own, count, cost) + _strain(log.of(responder_id), solved, own[0].chain)
        found.append(Node("responder", responder_id, own, misfit))
    return found


def _misfit(own: list[Pass], count: int, cost: float) -> float:
    """Return how much some of a node's passes cost, or all of them beside other nodes'.

    There are ``count`` passes in all, which cost as much as ``cost``.
    """
    own_cost = math.fsum(each.cost for each in own)
    rest_cost = (cost - own_cost) / max(count - len(own), 1)
    return math.fsum(max(each.cost - STANDS_OUT, 0.0) for each in own) + max(
        own_cost - TIMES_THE_REST * rest_cost * len(own), 0.0
    )


def _strain(own: ResponderLog, solved: Solved, index: int) -> float:
    """Return how much a responder's turns, scales, drifts and words cost beyond the usual."""
    bend = worst_bend(solved, index)
    strain = max(bend.cost - STANDS_OUT, 0.0)
    if own.fixes:
        # To where somebody says they are a way may have leapt.
        strain += max(bend.leap_cost - STANDS_OUT, 0.0)
    strain += max(worst_fix(solved, index, own)[0] - STANDS_OUT, 0.0)
    for unit in range(len(solved.assembled.chains[index].starts)):
        column = solved.assembled.unit_column(index, unit)
        sd = solved.assembled.graph.unit_sd[column - FIRST_UNIT : column - FIRST_UNIT + 2]
        scale, drift = (solved.arrow[column : column + 2] / sd).tolist()
        strain += max(scale * scale + drift * drift - EXPECTED_COST, 0.0)
    return strain


def _suspected(case: _Case, verdict: Verdict) -> Verdict:
    """Return the verdict with the best of the suspicions against all nodes that stand out.

    Where none is found, against the clock of the one responder whose way most likely bent to it.
    """
    kept = tuple(each.suspicion for each in verdict.held)
    log = supposed(case.log, kept)
    every = _nodes(log, verdict.solved)
    nodes = [node for node in every if node.misfit > LEAST_MISFIT]
    most_daps = max(1, sum(node.role == "dap" for node in every) // FEWEST_TO_ONE)
    examined = dict(verdict.examined)
    best: tuple[Solved, Held] | None = None
    passes = 0
    for role, most in case.suspects.items():
        if role == "dap" and _doubted_daps(verdict) >= most_daps:
            continue
        of_role = [node for node in nodes if node.role == role]
        for node in sorted(of_role, key=lambda each: (-each.misfit, each.node_id))[:most]:
            if examined.get(node.name) == len(node.passes):
                continue
            examined[node.name] = len(node.passes)
            found = _best(case, log, verdict.solved, node, of_role, kept)
            if found is not None and (best is None or _net(found[1]) > _net(best[1])):
                best, passes = found, len(node.passes)
    if best is None and not case.of_crowd:
        quiet = [node for node in every if node.role == "responder" and node not in nodes]
        fresh = [node for node in quiet if examined.get(LEANS + node.name) != len(node.passes)]
        examined |= {LEANS + node.name: len(node.passes) for node in fresh}
        pulled = leaning(fresh, verdict.solved)
        if pulled is not None:
            clocks = against_clock(verdict.solved, pulled)
            best = _best_of(case, log, verdict.solved, pulled, clocks, kept)
            passes = len(pulled.passes)
    if best is None or _net(best[1]) < 0.0:
        return verdict._replace(examined=examined)
    # What else stands out, or is held, may be due to the same, and is looked at again.
    rest = {name: count for name, count in verdict.examined.items() if not name.startswith(HELD)}
    raised = {_mark(RAISED, best[1].suspicion): passes}
    return Verdict(best[0], with_one_more(verdict.held, best[1]), rest | raised)


def with_one_more(held: tuple[Held, ...], fresh: Held) -> tuple[Held, ...]:
    """Return what is held with one more; a clock that is further off than was held is so by both.

    Otherwise either would be weighed as if the other were right, and both told.
    """
    ahead_s, gain, stood = fresh.suspicion.ahead_s, fresh.gain, fresh.stood
    alike = [each for each in held if each.suspicion[:3] == fresh.suspicion[:3]]
    if fresh.suspicion.kind != "clock" or not alike:
        return (*held, fresh)
    whole = fresh.suspicion._replace(
        ahead_s=math.fsum([ahead_s, *(each.suspicion.ahead_s for each in alike)])
    )
    whole_gain = math.fsum([gain, *(each.gain for each in alike)])
    stood = stood or any(each.stood for each in alike)
    rest = tuple(each for each in held if each not in alike)
    return (*rest, fresh._replace(suspicion=whole, gain=whole_gain, stood=stood))


def _doubted_daps(verdict: Verdict) -> int:
    return sum(held.suspicion.role == "dap" for held in verdict.held)


def _reviewed(case: _Case, verdict: Verdict, held: Held) -> Verdict:
    """Return the verdict with a suspicion that is held weighed again: kept, replaced or dropped."""
    rest = tuple(each for each in verdict.held if each.suspicion != held.suspicion)
    kept = tuple(each.suspicion for each in rest)
    without = _solved_with(case, verdict.solved, kept, None)
    if without is None:
        return verdict
    log = supposed(case.log, kept)
    nodes = _nodes(log, without)
    suspicion = held.suspicion
    node = next(
        (n for n in nodes if (n.role, n.node_id) == (suspicion.role, suspicion.node_id)), None
    )
    mark = _mark(HELD, suspicion)
    if node is None or verdict.examined.get(mark) == len(node.passes):
        return verdict
    examined = {**verdict.examined, mark: len(node.passes)}
    gain = _gain(without, verdict.solved, suspicion, node)
    best = _best(case, log, without, node, nodes, kept, again=True)
    if best is not None and _net(best[1]) > max(gain - PRICE[suspicion.kind] + BETTER_BY, 0.0):
        return Verdict(best[0], (*rest, best[1]), examined)
    if gain < KEPT_SHARE * PRICE[suspicion.kind]:
        return Verdict(without, rest, examined)
    # Who alone contradicts a DAP, or others, must have done so once more.
    is_new = len(node.passes) != verdict.examined.get(_mark(RAISED, suspicion))
    stood = held.stood or (gain > PRICE[suspicion.kind] and (is_new or not held.of_one))
    return Verdict(verdict.solved, (*rest, held._replace(gain=gain, stood=stood)), examined)


def _mark(what: str, suspicion: Suspicion) -> str:
    """Return by what name it is known by how many passes something was ``RAISED``, or ``HELD``."""
    return f"{what}{suspicion.role}/{suspicion.node_id}"


def _net(held: Held) -> float:
    return held.gain - PRICE[held.suspicion.kind]


def _best(
    case: _Case, log: TeamLog, solved: Solved, node: Node, others: list[Node],
    kept: tuple[Suspicion, ...], *, again: bool = False,
) -> tuple[Solved, Held] | None:  # fmt: skip
    """Return the best of the suspicions against a node, ``solved`` of ``log`` with those kept."""
    which = tried_of_crowd(case.number, again=again) if case.of_crowd else range(sys.maxsize)
    suspicions = islice(against(log, solved, node, others), which.start, which.stop)
    return _best_of(case, log, solved, node, suspicions, kept)


def _best_of(
    case: _Case, log: TeamLog, solved: Solved, node: Node, suspicions: Iterable[Suspicion],
    kept: tuple[Suspicion, ...],
) -> tuple[Solved, Held] | None:  # fmt: skip
    """Return the best of suspicions against a node beside those that are kept, and its solution."""
    best: tuple[Solved, Held] | None = None
    scales = sum(each.kind == "scale" for each in kept)
    placed_wrongly = {each.node_id for each in kept if each.kind == "misplaced"} - {node.node_id}
    chains = len(solved.assembled.chains)
    most_scales = max(1, chains // FEWEST_TO_ONE) if chains > 1 else 0
    screen = _screen(case, log, solved, node)
    for suspicion in suspicions:
        if suspicion.kind == "scale" and scales >= most_scales:
            continue
        if suspicion.kind == "misplaced" and len(placed_wrongly) >= max(1, most_scales):
            continue
        turns_rad = screen.turns_worth(suspicion, PRICE[suspicion.kind]) if screen else TURNS_RAD
        if not turns_rad:
            continue
        tried = _solved_with(case, solved, kept, suspicion, turns_rad)
        if tried is None:
            continue
        gain = _gain(solved, tried, suspicion, node)
        held = Held(suspicion, gain, of_one=node.role == "dap" and len(node.witnesses) < 2)
        if best is None or _net(held) > _net(best[1]):
            best = tried, held
    return best


def _screen(case: _Case, log: TeamLog, solved: Solved, node: Node) -> Screen | None:
    """Return what tells of a crowd which suspicions against a responder are worth a trial."""
    if not case.of_crowd or node.role != "responder":
        return None
    return Screen(log, solved, case.time_ns, case.noise, case.settings)


def _gain(without: Solved, solved: Solved, suspicion: Suspicion, node: Node) -> float:
    gain = without.cost - solved.cost
    if suspicion.kind == "scale" and scale_off(solved, node.passes[0].chain) < LEAST_SCALE_OFF:
        return 0.0
    if suspicion.kind == "astray":
        for each in node.passes:
            if each.dof and each.time_ns >= suspicion.since_ns:
                gain -= 2.0 * logarithm(ASTRAY_AREA_M2 / (2.0 * math.pi * each.sd_m**2))
    return gain


def _solved_with(
    case: _Case, begin: Solved, kept: tuple[Suspicion, ...], suspicion: Suspicion | None,
    turns_rad: tuple[float, ...] = TURNS_RAD,
) -> Solved | None:  # fmt: skip
    """Return the team solved as if all that were right, from ``begin`` and from nothing."""
    suspicions = (*kept, suspicion) if suspicion else kept
    log = supposed(case.log, suspicions)
    before = begin.solution(case.time_ns, case.noise)
    settings = case.settings
    if suspicion is not None and suspicion.kind == "renewed":
        return _turned_since(case, log, before, begin, suspicion, turns_rad)
    nothing = NOTHING._replace(noise=case.noise)
    tried = [
        solve(log, case.time_ns, each, begin.belief, settings, settings.commit_iterations)
        for each in ((before, nothing) if suspicion and suspicion.kind == "swapped" else (before,))
    ]
    sound = [each for each in tried if each is not None and each.is_sound]
    return min(sound, key=lambda each: each.cost, default=None)


def _turned_since(
    case: _Case, log: TeamLog, before: Solution, begin: Solved, suspicion: Suspicion,
    turns_rad: tuple[float, ...],
) -> Solved | None:  # fmt: skip
    """Return the best of the solutions with a responder's way turned since their unit changed."""
    assembled = assemble(log, case.time_ns, begin.belief, case.noise, case.settings)
    if assembled is None:
        return None
    assembled = by_floor(log, assembled, case.time_ns, case.settings)
    start, arrow = begin_from(before, assembled)
    best: Solved | None = None
    for pose in starts_turned(assembled, start, suspicion, turns_rad):
        tried = solved_from(
            assembled, pose, arrow.copy(), begin.belief, case.settings,
            case.settings.commit_iterations,
        )  # fmt: skip
        if tried.is_sound and (best is None or tried.cost < best.cost):
            best = tried
    return best
