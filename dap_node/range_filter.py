"""How likely it is that somebody is near: a Bayes filter over their range and their link's offset.

A threshold on a window's mean forgets what came before the window, and takes every radio for an
average one. This filter does neither. Its state is the range from the DAP, on a grid of rings, and
the offset (dB) of this link against the average one, which never changes: the two are estimated
together from all that was heard of the station so far, so that a box that hears everybody loudly
finds that out for itself. Range changes as by a walk without a preferred direction; its prior is
uniform over the floor's area.

A reading has the mean of the log-distance path loss model (Rappaport, "Wireless Communications",
section 4.9) plus the offset, and Gaussian spread; with some probability the wearer's body stands
in between and takes its loss. From far away, where walls count for more than metres, readings are
weak and of any strength, and say nothing of the offset. Shadowing stays while people move less
than some metre, so that readings in quick succession do not count as independent: together they
weigh as one reading for each coherence time.

Between readings people spread as by diffusion in the plane, in implicit (backward Euler) steps:
each is exact for a time that is exponential about the step's, so that none may be too long. The
grid is so small that plain lists do: arrays would take a DAP 11 MB.
"""

from __future__ import annotations

import math
from functools import lru_cache
from itertools import pairwise
from typing import NamedTuple, TypeAlias

from dap_node.range_settings import Belief, RangeSettings
from shared.units import NS_PER_S

Rings: TypeAlias = list[list[float]]
"""A value for each ring (n, from the DAP outwards) and in it for each offset (m)."""

POWER_AT_1_M_DBM = -40.0
"""What an average radio gives over a clear metre, once ``offset_db`` has been added."""

TICK_NS = NS_PER_S // 50
"""Times between readings are rounded to this."""

STEP_TICKS = 10
"""A step of motion is so long at most ..."""

MOST_STEPS = 8
"""... unless these are too few; after half an hour nothing is left of where somebody was."""

OFFSET_STEPS = tuple(step / 2.0 for step in range(-4, 5))
"""The grid of offsets, in standard deviations."""

RINGS_NEAR = 3
"""Rings of equal width that make up what is near."""

RING_GROWTH = 1.25
"""Farther rings are a quarter wider than the next inner one."""

LEAST_LIKELIHOOD = 1e-8
"""No single reading rules anything out altogether."""


class _Grid(NamedTuple):
    """Rings (n) by offsets (m): mean level and prior (n, m), and what makes motion.

    ``crossing_m2_s`` (n - 1,) is how much of a uniform density crosses each inner edge.
    """

    level_dbm: Rings
    prior: Rings
    range_m: list[float]
    area_m2: list[float]
    crossing_m2_s: list[float]
    is_far: list[bool]
    offset_db: list[float]


class _Sweep(NamedTuple):
    """Elimination of one ring (Thomas algorithm): from the inner one, by the pivot, to it."""

    inner: float
    pivot: float
    outer: float


class RangeFilter:
    """Follows one station. Readings are given in the order of time; ``believe`` looks ahead."""

    def __init__(self, settings: RangeSettings) -> None:
        self._settings = settings
        self._grid = _grid(settings)
        self._belief = self._grid.prior
        self._heard_ns: int | None = None

    def hear(self, time_ns: int, rssi_dbm: float) -> None:
        """Take in a reading. One that is not newer than the last says nothing any more."""
        weight = 1.0
        if self._heard_ns is not None:
            if time_ns <= self._heard_ns:
                return
            self._belief = self._moved(time_ns)
            weight = min(1.0, (time_ns - self._heard_ns) / NS_PER_S / self._settings.coherence_s)
        said = _log_likelihood(self._settings, rssi_dbm)
        belief = [
            [share * math.exp(weight * log) for share, log in zip(ring, logs, strict=True)]
            for ring, logs in zip(self._belief, said, strict=True)
        ]
        scale = 1.0 / sum(map(sum, belief))
        self._belief = [[scale * share for share in ring] for ring in belief]
        self._heard_ns = time_ns

    def believe(self, now_ns: int) -> Belief:
        """Return what is held of now, which is not before the last reading."""
        belief = self._moved(now_ns)
        rings = [sum(ring) for ring in belief]
        offsets = [sum(offset) for offset in zip(*belief, strict=True)]
        near = min(max(sum(rings[:RINGS_NEAR]), 1e-12), 1.0 - 1e-12)
        return Belief(
            math.log(near / (1.0 - near)),
            *_moments(rings, self._grid.range_m),
            *_moments(offsets, self._grid.offset_db),
        )

    def _moved(self, now_ns: int) -> Rings:
        """Return the belief as people have spread since the last reading."""
        ticks = 0 if self._heard_ns is None else (now_ns - self._heard_ns) // TICK_NS
        steps = min(math.ceil(ticks / STEP_TICKS), MOST_STEPS)
        belief = self._belief
        for _ in range(steps):
            belief = _spread(belief, _sweeps(self._settings, ticks / steps))
        return belief


def _spread(belief: Rings, sweeps: list[_Sweep]) -> Rings:
    """Return the belief after a step of motion: outwards each ring is solved for, then inwards."""
    solved: Rings = []
    before = [0.0] * len(belief[0])
    for ring, (inner, pivot, _) in zip(belief, sweeps, strict=True):
        before = [pivot * (b + inner * a) for a, b in zip(before, ring, strict=True)]
        solved.append(before)
    after = [0.0] * len(before)
    for at in range(len(solved) - 1, -1, -1):
        outer = sweeps[at].outer
        after = solved[at] = [b + outer * a for a, b in zip(after, solved[at], strict=True)]
    return solved


@lru_cache(maxsize=64)
def _sweeps(settings: RangeSettings, ticks: float) -> list[_Sweep]:
    """Return how the rings are solved for after a step of so many ticks.

    What crosses an edge goes with its length, over the distance between the rings; a uniform
    density stays.
    """
    step_s = ticks * TICK_NS / NS_PER_S
    area_m2 = _grid(settings).area_m2
    flow_m2 = [0.0, *(step_s * each for each in _grid(settings).crossing_m2_s), 0.0]
    sweeps: list[_Sweep] = []
    outer = 0.0
    for at, area in enumerate(area_m2):
        inner = flow_m2[at] / area_m2[at - 1]
        pivot = 1.0 / (1.0 + (flow_m2[at] + flow_m2[at + 1]) / area - inner * outer)
        gives_m2 = flow_m2[at + 1]
        outer = pivot * gives_m2 / area_m2[at + 1] if gives_m2 else 0.0
        sweeps.append(_Sweep(inner, pivot, outer))
    return sweeps


@lru_cache(maxsize=64)
def _log_likelihood(settings: RangeSettings, rssi_dbm: float) -> Rings:
    """Return the logarithm of the likelihood of a reading, the body in between or not."""
    grid, body_share = _grid(settings), settings.body_share
    far = math.log(_density(rssi_dbm - settings.far_dbm, settings.far_spread_db) + LEAST_LIKELIHOOD)

    def log(level_dbm: float) -> float:
        over_db = rssi_dbm - level_dbm
        clear = _density(over_db, settings.spread_db)
        blocked = _density(over_db + settings.body_loss_db, settings.spread_db)
        return math.log((1.0 - body_share) * clear + body_share * blocked + LEAST_LIKELIHOOD)

    return [
        [far] * len(levels) if is_far else [log(level) for level in levels]
        for levels, is_far in zip(grid.level_dbm, grid.is_far, strict=True)
    ]


@lru_cache(maxsize=64)
def _grid(settings: RangeSettings) -> _Grid:
    edge_m = _edges_m(settings)
    area_m2 = [math.pi * (outer**2 - inner**2) for inner, outer in pairwise(edge_m)]
    range_m = [math.sqrt((outer**2 + inner**2) / 2.0) for inner, outer in pairwise(edge_m)]
    crossing_m2_s = [
        settings.diffusion_m2_s * 2.0 * math.pi * edge / (outer - inner)
        for edge, (inner, outer) in zip(edge_m[1:-1], pairwise(range_m), strict=True)
    ]
    offset_db = [settings.offset_sd_db * step for step in OFFSET_STEPS]
    offset_prior = [math.exp(-0.5 * step**2) for step in OFFSET_STEPS]
    whole = sum(area_m2) * sum(offset_prior)
    level_dbm = [
        POWER_AT_1_M_DBM
        - 10.0 * settings.exponent * math.log10(math.hypot(each, settings.height_m))
        for each in range_m
    ]
    return _Grid(
        [[level + offset for offset in offset_db] for level in level_dbm],
        [[area * share / whole for share in offset_prior] for area in area_m2],
        range_m,
        area_m2,
        crossing_m2_s,
        [inner >= settings.far_m for inner in edge_m[:-1]],
        offset_db,
    )


def _edges_m(settings: RangeSettings) -> list[float]:
    """Return the rings' edges (n + 1,), from the DAP outwards."""
    edges = [settings.near_m * ring / RINGS_NEAR for ring in range(RINGS_NEAR + 1)]
    while edges[-1] < settings.farthest_m:
        edges.append(edges[-1] + RING_GROWTH * (edges[-1] - edges[-2]))
    return edges


def _density(over_db: float, spread_db: float) -> float:
    return math.exp(-0.5 * (over_db / spread_db) ** 2) / spread_db


def _moments(weights: list[float], values: list[float]) -> tuple[float, float]:
    pairs = list(zip(weights, values, strict=True))
    mean = sum(weight * value for weight, value in pairs)
    variance = sum(weight * (value - mean) ** 2 for weight, value in pairs)
    return mean, math.sqrt(variance)
