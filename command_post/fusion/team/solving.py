"""One moment's solution: from the last commit's, by way of other headings and axes (pure)."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from command_post.fusion.team.assembly import (
    ANY_AXIS_SD_RAD,
    NO_AXIS,
    Assembled,
    AxisBelief,
    Noise,
    assemble,
)
from command_post.fusion.team.axis import directions, likely_axis, told_by_legs, witnesses
from command_post.fusion.team.axis_choice import MOST_WORTH, best_of, rivals_of, worth_of
from command_post.fusion.team.chain import UnitName, turn_known
from command_post.fusion.team.graph import AXIS
from command_post.fusion.team.log import TeamLog
from command_post.fusion.team.marginals import ENDS_ONLY, NO_COVARIANCE
from command_post.fusion.team.move_log import Floats
from command_post.fusion.team.same_floor import by_floor
from command_post.fusion.team.settings import TeamSettings
from command_post.fusion.team.sharpness import learnt_noise
from command_post.fusion.team.smoother import log_determinant, smooth
from command_post.fusion.team.solution import Solution, begin_from, solution_of, turned
from command_post.fusion.team.unturned import gauge, turned_to, unturned_groups
from shared.maths.angles import HALF_PI, nearest_right_angle_rad, wrap_rad
from shared.units import NS_PER_S

KNOWN_TURNS_RAD = tuple(math.radians(each) for each in (-60.0, -30.0, 30.0, 60.0))
UNKNOWN_TURNS_RAD = tuple(math.radians(each) for each in range(-150, 181, 30))
QUARTERS_RAD = (-0.5 * math.pi, 0.5 * math.pi, math.pi)
UNDECIDED_COST = 9.0
"""Of two ways that differ by no more in cost, twice the logarithm of odds, either may be true."""
GAUGE_SD_RAD = math.radians(15.75)
"""A group that knows no heading is held to a turn so loosely, that others may be told by it."""
LEAST_NODES = 4
FREE_AXIS_COST = 3.0
NO_AXIS_COST = 4.0
"""How much less likely beforehand a building is that stands askew, or has no axis."""
FREE_AXIS_DENSITY_COST = 2.0 * math.log(HALF_PI) - math.log(2.0 * math.pi)
"""Of an axis that may be any, alike modulo a right angle, beside Gaussians without their 2π."""


class Turns(NamedTuple):
    """Ways in which the map of some ``chains``, by index, may be turned, each with its share."""

    chains: tuple[int, ...]
    ways: tuple[tuple[float, Solved], ...]


class Solved(NamedTuple):
    """A graph solved: poses (n, 3), arrow (A,), ends' covariances (R, 6), the arrow's (A, A).

    ``turns`` are of those groups whose turn no heading tells.
    """

    assembled: Assembled
    pose: Floats
    arrow: Floats
    cost: float
    ends: Floats
    shared: Floats
    belief: AxisBelief
    turns: tuple[Turns, ...] = ()

    @property
    def is_sound(self) -> bool:
        """Whether there is a solution at all."""
        return math.isfinite(self.cost) and bool(np.isfinite(self.pose).all())

    def tells_turn(self, index: int, settings: TeamSettings) -> bool:
        """Whether it is told, of all ways it may be, how the unit of a chain is turned by now.

        In a group that may be turned as a whole, it is how the unit is turned among the others.
        """
        chain = self.assembled.chains[index]
        if turn_known(chain.starts[int(chain.unit[-1])]):
            return True
        is_sharp = float(self.end_on_map(index)[3]) < settings.recovered_turn_sd_rad**2
        return is_sharp and chain.last_unit_name in self.belief.units

    def ways_of(self, index: int) -> tuple[tuple[float, Solved], ...]:
        """Return how the map of the chain at ``index`` may be turned; nothing if that is told."""
        return next((each.ways for each in self.turns if index in each.chains), ())

    def end_on_map(self, index: int) -> Floats:
        """Return the end's covariance (6,) of the chain at ``index``, its map not turned."""
        ways = self.ways_of(index)
        return np.asarray(ways[0][1].ends[index] if ways else self.ends[index])

    def noise(self, settings: TeamSettings) -> Noise:
        """Return how far passes and moves scatter by this solution."""
        return learnt_noise(self.assembled, self.pose, self.arrow, settings)

    def solution(self, time_ns: int, noise: Noise) -> Solution:
        """Return it by time and name, with how far passes and moves are held to scatter."""
        return solution_of(
            time_ns, self.assembled, self.pose, self.arrow, self.belief, self.cost, noise
        )


def solve(
    log: TeamLog, time_ns: int, before: Solution, belief: AxisBelief, settings: TeamSettings,
    iterations: int,
) -> Solved | None:  # fmt: skip
    """Return the team at ``time_ns``, started from ``before``; ``None`` if nobody has started."""
    assembled = assemble(log, time_ns, belief, before.noise, settings)
    if assembled is None:
        return None
    assembled = by_floor(log, assembled, time_ns, settings)
    begun = begin_from(before, assembled)
    return _begun(assembled, begun, before, belief, settings, iterations)


def _begun(
    assembled: Assembled, begun: tuple[Floats, Floats], before: Solution, belief: AxisBelief,
    settings: TeamSettings, iterations: int,
) -> Solved:  # fmt: skip
    """Return the graph solved under a belief from where it has ``begun``, which is improved."""
    pose, arrow = begun
    if belief.mode == "free" and before.belief.mode != "free":
        arrow[AXIS] = belief.axis_rad
    elif belief.mode == "given":
        # An axis is one with those at right angles to it: ways are turned to the nearest.
        arrow[AXIS] -= nearest_right_angle_rad(float(arrow[AXIS]) - belief.axis_rad)
    return solved_from(assembled, pose, arrow, belief, settings, iterations)


def solved_from(
    assembled: Assembled, pose: Floats, arrow: Floats, belief: AxisBelief,
    settings: TeamSettings, iterations: int, covariance: int = ENDS_ONLY,
) -> Solved:  # fmt: skip
    """Return the graph solved from ``pose`` and ``arrow``, which are improved in place."""
    cost, _, ends, shared = smooth(
        assembled.graph, pose, arrow, iterations, settings.settled_m, covariance
    )
    return Solved(assembled, pose, arrow, cost, ends, shared, belief)


def commit(log: TeamLog, time_ns: int, before: Solution, settings: TeamSettings) -> Solved | None:
    """Return the team at ``time_ns``, having tried other axes and other headings for everybody."""
    found = solved_with_axis(log, time_ns, before, settings)
    if found is not None:
        most = settings.turned_a_commit
        for chain in turned_at(time_ns, len(found.assembled.chains), most, settings):
            found = with_other_headings(found, chain, before.belief.units, settings)
    return found


def solved_with_axis(
    log: TeamLog, time_ns: int, before: Solution, settings: TeamSettings
) -> Solved | None:
    """Return the team at ``time_ns``, under the best of several beliefs of the building's axis."""
    found = solve(log, time_ns, before, before.belief, settings, settings.commit_iterations)
    if found is None:
        return None
    held = before.belief.units | _told_units(found, settings)
    if settings.axis:
        return _with_axis(before, found, held, settings)
    return found._replace(belief=found.belief._replace(units=held))


def turned_at(time_ns: int, chains: int, most: int, settings: TeamSettings) -> list[int]:
    """Return whose headings are tried at a commit: everybody's, of more than ``most`` by turns.

    Each trial solves the whole team, so that trying all of a crowd would take its square.
    """
    if chains <= most:
        return list(range(chains))
    first = time_ns // round(settings.commit_s * NS_PER_S) * most
    return sorted((first + k) % chains for k in range(most))


def _told_units(found: Solved, settings: TeamSettings) -> frozenset[UnitName]:
    """Return the units whose heading is known by now, well enough and no other way as well.

    In a group that knows no heading it is how they are headed among each other, if two are told.
    """
    groups = [group for group in unturned_groups(found.assembled) if len(group) > 1]
    alone = set(range(len(found.assembled.chains))).difference(*groups)
    told = _told_of(found, alone, settings)
    for group in groups:
        row, node = gauge(found.assembled, group)
        fixed = turned_to(found.assembled, row, float(found.pose[node, 2]), GAUGE_SD_RAD)
        among = solved_from(
            fixed, found.pose.copy(), found.arrow.copy(), found.belief, settings,
            settings.commit_iterations,
        )  # fmt: skip
        of_group = _told_of(among, set(group), settings)
        told |= of_group if len(of_group) > 1 else frozenset()
    return told


def _told_of(found: Solved, chains: set[int], settings: TeamSettings) -> frozenset[UnitName]:
    known = found.belief.units
    return frozenset(
        chain.last_unit_name
        for index, chain in enumerate(found.assembled.chains)
        if index in chains
        and found.ends[index, 3] < settings.axis_from_turn_sd_rad**2
        and (
            chain.last_unit_name in known
            or turn_known(chain.starts[int(chain.unit[-1])])
            or _is_decided(found, index, settings)
        )
    )


def _is_decided(found: Solved, index: int, settings: TeamSettings) -> bool:
    """Whether a unit's way suits what it passed far worse if it is turned by right angles."""
    assembled = found.assembled
    unit = int(assembled.chains[index].unit[-1])
    end = int(assembled.graph.first[index + 1]) - 1
    for quarter_rad in QUARTERS_RAD:
        pose, arrow = turned(assembled, found.pose, found.arrow, index, quarter_rad, unit)
        other = solved_from(
            assembled, pose, arrow, found.belief, settings, settings.commit_iterations,
            NO_COVARIANCE,
        )  # fmt: skip
        apart_rad = abs(wrap_rad(float(other.pose[end, 2] - found.pose[end, 2])))
        if apart_rad > 0.25 * math.pi and other.cost < found.cost + UNDECIDED_COST:
            return False
    return True


def _with_axis(
    before: Solution, found: Solved, held: frozenset[UnitName], settings: TeamSettings
) -> Solved:
    """Return the solution under the belief of the building that explains the team's ways best.

    No axis is believed in unless ways that are held to none go along one. That it is the one given
    is not believed before it is known well, by headings, whichever it be: a lone responder who
    hardly knows their heading suits any.
    """
    begun = begin_from(before, found.assembled)

    def under(belief: AxisBelief) -> Solved:
        if belief == found.belief:
            return found
        believing, (pose, arrow) = found.assembled.believing(belief, settings), begun
        from_here = pose.copy(), arrow.copy()
        return _begun(believing, from_here, before, belief, settings, settings.commit_iterations)

    found = found._replace(belief=found.belief._replace(rivals=()))
    unheld = under(NO_AXIS._replace(units=held))
    if not unheld.is_sound:
        return unheld
    directions_rad = directions(unheld.assembled, unheld.pose, held, settings)
    if directions_rad.size < settings.axis_least_moves:
        return unheld
    likely_rad = likely_axis(directions_rad, settings.straight_sd_rad)
    free = under(AxisBelief("free", likely_rad, ANY_AXIS_SD_RAD, held))
    trials = [free, unheld]
    if free.shared[AXIS, AXIS] < settings.axis_seen_sd_rad**2:
        given = AxisBelief("given", settings.axis_rad, settings.axis_sd_rad, held)
        # Whoever is alone at an incident may as well walk askew to it: nobody else's legs tell.
        if len(found.assembled.chains) > 1:
            trials.insert(0, under(given))
        if _may_be_planned(free, before.belief, settings):
            planned_rad = settings.planned_axis_rad or 0.0
            trials.insert(0, under(given._replace(axis_rad=planned_rad)))
    best = _best(trials, before.belief, settings)
    if best.belief.mode not in ("given", before.belief.mode) and before.belief.mode != "none":
        # One whose heading is held to the wrong right angle speaks against an axis as well.
        anew = [_turned_to(unheld, tried.belief, settings) for tried in trials[:-1]]
        best = _best([*anew, unheld], before.belief, settings)
    return best


def _best(trials: list[Solved], held: AxisBelief, settings: TeamSettings) -> Solved:
    """Return the trial to be acted upon, with how likely others are; the last has no axis."""
    costs = [_belief_cost(tried, settings) for tried in trials]
    beliefs = [
        tried.belief._replace(axis_rad=float(tried.arrow[AXIS]))
        if tried.belief.mode == "free"
        else tried.belief
        for tried in trials
    ]
    alone = len(trials[0].assembled.chains) == 1
    # Of who is alone nobody else's heading tells theirs.
    turn_rad2 = [tried.ends[:, 3].tolist() for tried in (trials[0], trials[-1])]
    worth = MOST_WORTH if alone else worth_of(*turn_rad2)
    chosen = best_of(beliefs, costs, held, settings.adopt_gain, worth=worth, alone=alone)
    best = trials[chosen]
    return best._replace(belief=best.belief._replace(rivals=rivals_of(beliefs, costs, best.belief)))


def _turned_to(unheld: Solved, belief: AxisBelief, settings: TeamSettings) -> Solved:
    """Return the solution under a belief, begun where all were that were held to no axis."""
    arrow = unheld.arrow.copy()
    arrow[AXIS] = belief.axis_rad
    return solved_from(
        unheld.assembled.believing(belief, settings), unheld.pose.copy(), arrow, belief, settings,
        settings.commit_iterations,
    )  # fmt: skip


def _may_be_planned(free: Solved, held: AxisBelief, settings: TeamSettings) -> bool:
    """Whether the plan's axis is as near as it must be to where it was found when it was free.

    Once it is believed in, ``held``, it may be twice as far.
    """
    if settings.planned_axis_rad is None:
        return False
    most_off = settings.planned_axis_most_off
    if held.mode == "given" and held.axis_rad == settings.planned_axis_rad:
        most_off *= 2.0
    off_rad = float(free.arrow[AXIS]) - settings.planned_axis_rad
    off_rad -= nearest_right_angle_rad(off_rad)
    found_rad2 = float(free.shared[AXIS, AXIS]) + settings.axis_sd_rad**2
    return off_rad**2 < most_off**2 * found_rad2


def _belief_cost(tried: Solved, settings: TeamSettings) -> float:
    """Return twice the negative logarithm of a belief's probability, up to a constant.

    It is its evidence, by Laplace's approximation about the solution (MacKay, "Bayesian
    interpolation", 1992): an axis gains little by legs along it where headings may be turned to
    suit any. All straight moves are held to an axis, but one leg of each corridor tells of it: with
    the others its width would be that of headings which the corridor tells, axis or not. So
    it is told about where these alone have everybody: else all that the others bend, who tell
    nothing, would speak against an axis.
    """
    belief, pose, arrow = tried.belief, tried.pose.copy(), tried.arrow.copy()
    told = witnesses(tried.assembled.graph, pose)
    if belief.mode == "none":
        return tried.cost + log_determinant(told, pose, arrow) + NO_AXIS_COST
    cost, *_ = smooth(
        told, pose, arrow, settings.commit_iterations, settings.settled_m, NO_COVARIANCE
    )
    of_moves, of_legs = told_by_legs(told, pose, arrow, settings.axis_least_share)
    cost += log_determinant(told, pose, arrow) + of_legs - of_moves
    if belief.mode == "given":
        return cost + 2.0 * math.log(belief.sd_rad)
    return cost + FREE_AXIS_COST + FREE_AXIS_DENSITY_COST


def with_other_headings(
    found: Solved, chain: int, known: frozenset[UnitName], settings: TeamSettings
) -> Solved:
    """Return the best of the solution and those with one responder's way turned as a whole.

    Of one whose unit began anew, its way since then is turned as well, unless it is one of those
    ``known`` before: where it is held to an axis for the first time, that may be the wrong way.

    It is ``found`` itself that comes back if no other is better.
    """
    assembled = found.assembled
    if len(assembled.nodes[chain]) < LEAST_NODES:
        return found
    own = assembled.chains[chain]
    turns_rad = KNOWN_TURNS_RAD if turn_known(own.starts[0]) else UNKNOWN_TURNS_RAD
    trials = [(0, turn_rad) for turn_rad in turns_rad]
    unit = int(own.unit[-1])
    if unit and not turn_known(own.starts[unit]) and own.last_unit_name not in known:
        trials += [(unit, turn_rad) for turn_rad in UNKNOWN_TURNS_RAD]
    best = found
    for since, turn_rad in trials:
        pose, arrow = turned(assembled, found.pose, found.arrow, chain, turn_rad, since)
        tried = solved_from(
            assembled, pose, arrow, found.belief, settings, settings.commit_iterations,
            NO_COVARIANCE,
        )  # fmt: skip
        if tried.cost < best.cost - settings.adopt_gain:
            best = tried
    if best is found:
        return found
    return solved_from(
        assembled, best.pose, best.arrow, best.belief, settings, settings.commit_iterations
    )
