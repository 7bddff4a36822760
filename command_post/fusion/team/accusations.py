"""What each node may be suspected of, by which of its passes stand out (pure)."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from command_post.fusion.team.log import ResponderLog, TeamLog
from command_post.fusion.team.misfits import (
    STANDS_OUT,
    Pass,
    best_ahead_s,
    best_since,
    best_split,
    leans,
    worst_bend,
    worst_fix,
)
from command_post.fusion.team.solving import Solved
from command_post.fusion.team.suspicions import Suspicion
from shared.topics import Role

LEAST_PASSES = 3
MOST_AHEAD_S = 15.0
FAR_AHEAD_S = 3.0


class Node(NamedTuple):
    """A node with its passes in the order of time, and how much they cost beyond the usual."""

    role: Role
    node_id: str
    passes: list[Pass]
    misfit: float

    @property
    def name(self) -> str:
        """What it is known by from one commit to the next."""
        return f"{self.role}/{self.node_id}"

    @property
    def of_daps(self) -> list[Pass]:
        """Those of them that date by its own clock: where two met, either's may be meant."""
        return [each for each in self.passes if each.place[0] == "dap"]

    @property
    def witnesses(self) -> set[int]:
        """Whose passes of it stand out, by chain."""
        return {each.chain for each in self.passes if each.cost > STANDS_OUT}


def against(log: TeamLog, solved: Solved, node: Node, others: list[Node]) -> Iterator[Suspicion]:
    """Say what a node may be suspected of, as the team is solved of ``log``."""
    since_ns = _between(node.passes, best_since(node.passes))
    if node.role == "dap":
        yield from _against_dap(solved, node, since_ns)
    else:
        yield from _against_responder(log, solved, node, others, since_ns)


def _against_dap(solved: Solved, node: Node, since_ns: int) -> Iterator[Suspicion]:
    first_ns = node.passes[0].time_ns
    if len(node.passes) < LEAST_PASSES:
        return
    split = best_split(node.passes)
    if split is not None:
        yield Suspicion("moved", "dap", node.node_id, _between(node.passes, split[0]))
    # What one responder alone contradicts says more about them.
    if len(node.witnesses) > 1:
        for time_ns in sorted({first_ns, since_ns}):
            yield Suspicion("astray", "dap", node.node_id, time_ns)
    for ahead_s in _clocks_ahead_s(solved, node):
        yield Suspicion("clock", "dap", node.node_id, first_ns, ahead_s=ahead_s)


def _against_responder(
    log: TeamLog, solved: Solved, node: Node, others: list[Node], since_ns: int
) -> Iterator[Suspicion]:
    chain = node.passes[0].chain
    begin_ns = int(solved.assembled.chains[chain].time_ns[0])
    for time_ns in sorted(_doubtful_words(log.of(node.node_id), solved, chain)):
        yield Suspicion("misplaced", "responder", node.node_id, time_ns)
    yield Suspicion("scale", "responder", node.node_id, begin_ns)
    # What one DAP alone contradicts says more about it, if others were passed.
    passed = {each.place[:2] for each in node.passes}
    stand_out = {each.place[:2] for each in node.passes if each.cost > STANDS_OUT}
    bend = worst_bend(solved, chain)
    if len(stand_out) == 1 < len(passed) and bend.cost <= STANDS_OUT:
        return
    yield from against_clock(solved, node)
    for time_ns in sorted({bend.time_ns, since_ns}):
        if time_ns > begin_ns:
            yield Suspicion("renewed", "responder", node.node_id, time_ns)
    for other in others:
        if other.role == "responder" and other.node_id != node.node_id:
            for time_ns in sorted({0, since_ns}):
                yield Suspicion("swapped", "responder", node.node_id, time_ns, other.node_id)


def against_clock(solved: Solved, node: Node) -> Iterator[Suspicion]:
    """Say by how much a responder's clock may be ahead."""
    begin_ns = int(solved.assembled.chains[node.passes[0].chain].time_ns[0])
    for ahead_s in _clocks_ahead_s(solved, node):
        yield Suspicion("clock", "responder", node.node_id, begin_ns, ahead_s=ahead_s)


def leaning(nodes: list[Node], solved: Solved) -> Node | None:
    """Return the responder all of whose passes of DAPs pull most to be sooner, or later, if any."""
    pulls = {node.node_id: leans(solved, node.of_daps) for node in nodes}
    most = max(nodes, key=lambda each: (pulls[each.node_id], each.node_id), default=None)
    return most if most and pulls[most.node_id] > 0.0 else None


def _doubtful_words(own: ResponderLog, solved: Solved, chain: int) -> set[int]:
    """Return when it was said where a responder was that may not be so.

    That is where each unit was said to begin, unless it was reckoned, and the word that fits least:
    where all fit, and the way leaps to them perhaps, the last one.
    """
    starts = solved.assembled.chains[chain].starts
    found = {each.time_ns for each in starts if each.position and each.down_sd_m is None}
    cost, time_ns = worst_fix(solved, chain, own)
    if own.fixes:
        found.add(time_ns if cost > STANDS_OUT else own.fixes[-1].time_ns)
    return found


def _clocks_ahead_s(solved: Solved, node: Node) -> list[float]:
    """Return by how much a clock may be ahead: as the ways suggest, which bent to it, or twice.

    Or in between, where that is far off.
    """
    ahead_s = best_ahead_s(solved, node.of_daps, of_responder=node.role == "responder")
    longer = (2.0,) if abs(ahead_s) <= FAR_AHEAD_S else (1.25, 1.5, 2.0)
    return sorted({
        ahead_s, *(max(min(each * ahead_s, MOST_AHEAD_S), -MOST_AHEAD_S) for each in longer)
    })  # fmt: skip


def _between(passes: list[Pass], at: int) -> int:
    """Return a time between a pass and the one before."""
    if at == 0:
        return passes[0].time_ns
    return (passes[at - 1].time_ns + passes[at].time_ns) // 2
