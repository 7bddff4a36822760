"""Whether what is wrong in exercises was named, and whom it harmed."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from command_post.evaluation.errors import RunErrors
from command_post.evaluation.score_card import Radii, radii
from command_post.nodes.notices import DOUBT, WRONG_CLOCK
from shared.messages import NodeId
from shared.simulation.scenario import Scenario

NAMED_AS: Mapping[str, str] = {
    "scale": "scale",
    "clock_ahead_s": "clock",
    "turned_deg": "renewed",
    "moved_to_m": "moved",
    "moved_by_m": "moved",
    "replays_s": "astray",
    "jammed": "astray",
    "swapped_with": "swapped",
}
"""As what each fault is rightly told. A unit that begins anew says so itself."""


class WrongThing(NamedTuple):
    """What is wrong with one node, or two that are swapped, since when, and as what it is told."""

    node_ids: frozenset[NodeId]
    since_s: float
    named_as: frozenset[str]


class Trial(NamedTuple):
    """One run: its errors, those of the same seed with all in order, and what was told when (s).

    ``told_s`` is by what it was, and of whom.
    """

    errors: RunErrors
    in_order: RunErrors
    told_s: Mapping[tuple[str, str], float]


class Harm(msgspec.Struct, frozen=True):
    """Live errors of the same nodes with all in order, and with something wrong."""

    in_order: Radii | None
    wrong: Radii | None


class Naming(msgspec.Struct, frozen=True, kw_only=True):
    """What became of runs in which something was wrong.

    Of ``things`` that were wrong so many were named ``rightly``, ``after_s`` from when they began,
    in the median; of others something else was told (``otherwise``). ``falsely`` is in how many
    runs what was told of nodes with which nothing was wrong. Errors are live: of the responders
    with whom something was wrong, of the others, and of the DAPs with which something was.
    """

    runs: int
    things: int
    rightly: int
    otherwise: int
    after_s: float | None
    falsely: dict[str, int]
    affected: Harm
    others: Harm
    daps: Harm


def wrong_things(scenario: Scenario) -> list[WrongThing]:
    """Return what ought to be named, once each."""
    found = []
    for node_id, fault in scenario.faults.items():
        named_as = frozenset(NAMED_AS[field] for field in fault.told() if field in NAMED_AS)
        nodes = {node_id} if fault.swapped_with is None else {node_id, fault.swapped_with}
        if named_as:
            found.append(WrongThing(frozenset(nodes), fault.since_s, named_as))
    return found


def naming(scenario: Scenario, trials: Sequence[Trial]) -> Naming:
    """Return what became of ``trials`` of ``scenario`` with its faults.

    DAPs that nobody set down in a run are not wrong in it.
    """
    things = wrong_things(scenario)
    nodes = frozenset(node_id for thing in things for node_id in thing.node_ids)
    named_s: list[float | None] = []
    otherwise = 0
    falsely: Counter[str] = Counter()
    for trial in trials:
        doubts_s = _doubts_s(trial.told_s)
        falsely.update(f"{node_id} {what}" for what, node_id in doubts_s if node_id not in nodes)
        for thing in things:
            if not thing.node_ids <= _there(scenario, trial.in_order):
                continue
            of_it = {each: at for each, at in doubts_s.items() if each[1] in thing.node_ids}
            rightly_s = [at for (what, _), at in of_it.items() if what in thing.named_as]
            named_s.append(min(rightly_s) - thing.since_s if rightly_s else None)
            otherwise += bool(of_it) and not rightly_s
    after_s = [each for each in named_s if each is not None]
    return Naming(
        runs=len(trials), things=len(named_s), rightly=len(after_s), otherwise=otherwise,
        after_s=float(np.median(after_s)) if after_s else None,
        falsely=dict(sorted(falsely.items())),
        affected=_harm(_tracks_of(trials, nodes)),
        others=_harm(_tracks_of(trials, frozenset(scenario.responders) - nodes)),
        daps=_harm(_daps_of(trials, nodes)),
    )  # fmt: skip


def _doubts_s(told_s: Mapping[tuple[str, str], float]) -> dict[tuple[str, str], float]:
    """Return when each node was first told to be wrong, by as what and of whom."""
    found: dict[tuple[str, str], float] = {}
    for (reason, node_id), time_s in told_s.items():
        if reason.startswith(DOUBT) or reason == WRONG_CLOCK:
            kind = "clock" if reason == WRONG_CLOCK else reason.removeprefix(DOUBT)
            found[kind, node_id] = min(time_s, found.get((kind, node_id), time_s))
    return found


def _there(scenario: Scenario, errors: RunErrors) -> set[NodeId]:
    """Return all who take part in a run."""
    stand = (name for name, dap in scenario.daps.items() if dap.position_m is not None)
    return {*errors.live.responders, *errors.live.dap_m, *stand}


_Pair = tuple[NDArray[np.float64], NDArray[np.float64]]


def _tracks_of(trials: Sequence[Trial], nodes: frozenset[NodeId]) -> Iterator[_Pair]:
    """Yield errors (m) of tracks with all in order and with something wrong, where both are."""
    for each in trials:
        wrong, in_order = each.errors.live.responders, each.in_order.live.responders
        for name in sorted(nodes & wrong.keys() & in_order.keys()):
            yield in_order[name].absolute_m, wrong[name].absolute_m


def _daps_of(trials: Sequence[Trial], nodes: frozenset[NodeId]) -> Iterator[_Pair]:
    for each in trials:
        wrong, in_order = each.errors.live.dap_m, each.in_order.live.dap_m
        for name in sorted(nodes & wrong.keys() & in_order.keys()):
            yield np.array([in_order[name]]), np.array([wrong[name]])


def _harm(pairs: Iterator[_Pair]) -> Harm:
    both = list(pairs)
    return Harm(radii(in_order for in_order, _ in both), radii(wrong for _, wrong in both))
