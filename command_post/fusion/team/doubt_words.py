"""In words, what is held against nodes (pure)."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator

from command_post.fusion.interface import Doubt
from command_post.fusion.team.doubts import PRICE
from command_post.fusion.team.solution import Held

SURE_BY = 9.0
"""What explains by so much more than its price is told at once: odds of ninety to one. The rest is
heeded, and told once it has stood against what was passed since. So is all that one responder
alone contradicts of a DAP."""

MOST_CERTAIN = 0.99


def doubts_of(held: tuple[Held, ...]) -> tuple[Doubt, ...]:
    """Return in words what is surely held against nodes, of either of two that are mistaken."""
    sure = [each for each in held if each.stood or _is_plain(each)]
    return tuple(doubt for each in _still_so(sure) for doubt in _worded(each))


def _is_plain(held: Held) -> bool:
    return not held.of_one and held.gain - PRICE[held.suspicion.kind] > SURE_BY


def _still_so(held: list[Held]) -> list[Held]:
    """Return what is so now: radios swapped twice go by their own names again."""
    swapped = Counter(_pair(each) for each in held if each.suspicion.kind == "swapped")
    again = {pair for pair, times in swapped.items() if times % 2 == 0}
    return [each for each in held if _pair(each) not in again]


def _pair(held: Held) -> frozenset[str]:
    return frozenset({held.suspicion.node_id, held.suspicion.other_id})


def _worded(held: Held) -> Iterator[Doubt]:
    suspicion = held.suspicion
    odds = math.exp(min(0.5 * (held.gain - PRICE[suspicion.kind]), 50.0))
    certainty = min(odds / (1.0 + odds), MOST_CERTAIN)
    ahead_s = suspicion.ahead_s
    words = {
        "moved": "has been moved: it is passed elsewhere",
        "astray": "jammed or replayed: what it tells fits nobody, and is not used",
        "clock": f"clock {abs(ahead_s):.1f} s {'ahead' if ahead_s > 0.0 else 'behind'}",
        "swapped": f"radio swapped with {suspicion.other_id}",
        "renewed": "boot unit changed or turned on the foot",
        "scale": "strides too long or too short",
        "misplaced": "was not where that was said",
    }[suspicion.kind]
    yield Doubt(
        suspicion.kind, suspicion.role, suspicion.node_id, suspicion.since_ns, words, certainty
    )
    if suspicion.kind == "swapped":
        yield Doubt(
            suspicion.kind, suspicion.role, suspicion.other_id, suspicion.since_ns,
            f"radio swapped with {suspicion.node_id}", certainty,
        )  # fmt: skip
