"""Which belief of a building's axis is acted upon, and how likely the others are (pure).

Headings known to 30 degrees, four tied together, tell how a map is turned to 15. So a house at 45
degrees to the axis that is taken for granted looks like one along it in a good part of all cases:
whichever is chosen, some are wrong. What squared errors expect least of is what is likelier than
not, and of what is held so far no more is made than flicker needs.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from command_post.fusion.team.arithmetic import exponential, logarithm
from command_post.fusion.team.assembly import AxisBelief, Rival

MOST_WORTH = 4.0
"""By no more may an axis be less likely than none, and be believed in."""
LEAST_TURN_RAD2 = 1e-9
FLICKER_COST = 1.0
"""By so much an axis given, or what speaks against it, has the better of a tie once believed in."""


def worth_of(along_rad2: Sequence[float], free_rad2: Sequence[float]) -> float:
    """Return by how much an axis may be less likely than none, and is believed in.

    Where it is right somebody is near one place, else they are anywhere along an arc: none of its
    places is as likely as that, by as much as the arc is longer. ``along_rad2`` and ``free_rad2``
    are the variances of everybody's turn along the axis and along none: where a heading that is
    known tells the others' without an axis, there is little to be won by one.
    """
    longer = [
        logarithm(max(free, LEAST_TURN_RAD2) / max(along, LEAST_TURN_RAD2))
        for along, free in zip(along_rad2, free_rad2, strict=True)
    ]
    return min(max(math.fsum(longer) / len(longer), 0.0), MOST_WORTH)


def best_of(
    beliefs: Sequence[AxisBelief], costs: Sequence[float], held: AxisBelief, adopt_gain: float,
    *, worth: float, alone: bool,
) -> int:  # fmt: skip
    """Return which of several beliefs, one of them of no axis, is to be acted upon.

    ``costs`` are twice negative logarithms of their probabilities. Along another axis and along
    none the map lies as headings have it: both speak together against an axis given, by which it
    is turned. An axis is ``worth`` so much more than none. Of two axes given the one ``held`` has
    the better of a tie, by ``adopt_gain``; and of who is ``alone`` the evidence has to say as
    loudly whether there is an axis: one drift of theirs turns all their legs.
    """
    given: list[tuple[float, int]] = []
    others: list[tuple[float, int]] = []
    for index, (belief, cost) in enumerate(zip(beliefs, costs, strict=True)):
        changes = alone and (belief.mode == "none") != (held.mode == "none")
        changes |= belief.mode == held.mode == "given" and belief.axis_rad != held.axis_rad
        more = worth if belief.mode == "none" else 0.0
        weighed = (cost + more + (adopt_gain if changes else 0.0), index)
        (given if belief.mode == "given" else others).append(weighed)
    least, best = min(others)
    if not given:
        return best
    odds = math.fsum(exponential(0.5 * (least - cost)) for cost, _ in others)
    together = least - 2.0 * logarithm(odds)
    flicker = FLICKER_COST if held.mode == "given" else -FLICKER_COST
    least_given, best_given = min(given)
    return best_given if least_given < together + flicker else best


def rivals_of(
    beliefs: Sequence[AxisBelief], costs: Sequence[float], best: AxisBelief
) -> tuple[Rival, ...]:
    """Return how likely each belief is but the ``best``: of an axis given the likelier one."""
    least = min(costs)
    odds = [exponential(0.5 * (least - cost)) for cost in costs]
    of_mode: dict[str, int] = {}
    for index, belief in enumerate(beliefs):
        if odds[index] > odds[of_mode.setdefault(belief.mode, index)]:
            of_mode[belief.mode] = index
    total = math.fsum(odds[index] for index in of_mode.values())
    return tuple(
        Rival(mode, beliefs[index].axis_rad, beliefs[index].sd_rad, odds[index] / total)
        for mode, index in of_mode.items()
        if mode != best.mode
    )
