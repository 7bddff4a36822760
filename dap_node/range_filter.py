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
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from dap_node.range_settings import Belief, RangeSettings
from shared.units import NS_PER_S

Array: TypeAlias = NDArray[np.float64]

POWER_AT_1_M_DBM = -40.0
"""What an average radio gives over a clear metre, once ``offset_db`` has been added."""

STEP_NS = NS_PER_S // 10
"""Range changes in steps of this."""

SUBSTEPS = 2**10
"""A step's motion is made of so many small ones, each all but linear."""

DOUBLINGS = 14
"""After 2^14 steps, half an hour, nothing is left of where somebody was."""

OFFSET_STEPS = np.linspace(-2.0, 2.0, 9)
"""The grid of offsets, in standard deviations."""

RINGS_NEAR = 3
"""Rings of equal width that make up what is near."""

RING_GROWTH = 1.25
"""Farther rings are a quarter wider than the next inner one."""

LEAST_LIKELIHOOD = 1e-8
"""No single reading rules anything out altogether."""


class _Grid(NamedTuple):
    """Rings (n) by offsets (m): mean level and prior (n, m), and motion in 2^k steps (n, n)."""

    level_db: Array
    prior: Array
    motions: list[Array]
    is_far: NDArray[np.bool_]
    range_m: Array
    offset_db: Array


class RangeFilter:
    """Follows one station. Readings are given in the order of time; ``believe`` looks ahead."""

    def __init__(self, settings: RangeSettings) -> None:
        self._settings = settings
        self._grid = _grid(settings)
        self._belief = self._grid.prior
        self._step = 0
        self._heard_ns: int | None = None

    def hear(self, time_ns: int, rssi_dbm: float) -> None:
        """Take in a reading. One that is not newer than the last says nothing any more."""
        if self._heard_ns is not None and time_ns <= self._heard_ns:
            return
        step = time_ns // STEP_NS
        if self._heard_ns is None:
            weight = 1.0
        else:
            self._belief = self._moved(step - self._step)
            weight = min(1.0, (time_ns - self._heard_ns) / NS_PER_S / self._settings.coherence_s)
        belief = self._belief * self._likelihood(rssi_dbm) ** weight
        self._belief = belief / belief.sum()
        self._step, self._heard_ns = step, time_ns

    def believe(self, now_ns: int) -> Belief:
        """Return what is held of now, which is not before the last reading."""
        steps = now_ns // STEP_NS - self._step if self._heard_ns is not None else 0
        belief = self._moved(max(0, steps))
        ring, offset = belief.sum(axis=1), belief.sum(axis=0)
        near = float(np.clip(ring[:RINGS_NEAR].sum(), 1e-12, 1.0 - 1e-12))
        return Belief(
            float(np.log(near / (1.0 - near))),
            *_moments(ring, self._grid.range_m),
            *_moments(offset, self._grid.offset_db),
        )

    def _moved(self, steps: int) -> Array:
        """Return the belief after so many steps without a reading."""
        belief = self._belief
        for doubling, motion in enumerate(self._grid.motions):
            if steps >> doubling & 1:
                belief = motion @ belief
        return belief if steps < 2**DOUBLINGS else self._forgotten(belief)

    def _forgotten(self, belief: Array) -> Array:
        """Return a belief of which only the offset is left."""
        prior = self._grid.prior
        return np.asarray(prior.sum(axis=1, keepdims=True) * belief.sum(axis=0))

    def _likelihood(self, rssi_dbm: float) -> Array:
        """Return the likelihood (n, m) of a reading, the body in between or not."""
        settings = self._settings
        over_db = rssi_dbm - self._grid.level_db
        clear = _density(over_db, settings.spread_db)
        blocked = _density(over_db + settings.body_loss_db, settings.spread_db)
        likelihood = (1.0 - settings.body_share) * clear + settings.body_share * blocked
        far = _density(np.array(rssi_dbm - settings.far_dbm), settings.far_spread_db)
        likelihood[self._grid.is_far] = far
        return np.asarray(likelihood + LEAST_LIKELIHOOD)


@lru_cache(maxsize=64)
def _grid(settings: RangeSettings) -> _Grid:
    edge_m = _edges_m(settings)
    area_m2 = np.pi * np.diff(edge_m**2)
    range_m = np.sqrt((edge_m[1:] ** 2 + edge_m[:-1] ** 2) / 2.0)
    offset_db = settings.offset_sd_db * OFFSET_STEPS
    offset_prior = np.exp(-0.5 * OFFSET_STEPS**2)
    loss_db = 10.0 * settings.exponent * np.log10(np.hypot(range_m, settings.height_m))
    motions = [_motion(edge_m, range_m, area_m2, settings.diffusion_m2_s)]
    for _ in range(DOUBLINGS - 1):
        motions.append(motions[-1] @ motions[-1])
    return _Grid(
        (POWER_AT_1_M_DBM - loss_db)[:, None] + offset_db,
        np.outer(area_m2 / area_m2.sum(), offset_prior / offset_prior.sum()),
        motions,
        edge_m[:-1] >= settings.far_m,
        range_m,
        offset_db,
    )


def _edges_m(settings: RangeSettings) -> Array:
    """Return the rings' edges (n + 1,), from the DAP outwards."""
    edges = np.linspace(0.0, settings.near_m, RINGS_NEAR + 1).tolist()
    while edges[-1] < settings.farthest_m:
        edges.append(edges[-1] + RING_GROWTH * (edges[-1] - edges[-2]))
    return np.array(edges)


def _motion(edge_m: Array, range_m: Array, area_m2: Array, diffusion_m2_s: float) -> Array:
    """Return how a distribution over the rings (n,) changes in a step: (n, n), columns sum to 1.

    Diffusion in the plane: what crosses an edge goes with its length, over the distance between
    the rings. A uniform density stays.
    """
    crossing_m2_s = diffusion_m2_s * 2.0 * np.pi * edge_m[1:-1] / np.diff(range_m)
    inner = np.arange(len(crossing_m2_s))
    rate = np.zeros((len(area_m2), len(area_m2)))
    rate[inner + 1, inner] = crossing_m2_s / area_m2[:-1]
    rate[inner, inner + 1] = crossing_m2_s / area_m2[1:]
    rate -= np.diag(rate.sum(axis=0))
    small = np.eye(len(area_m2)) + rate * (STEP_NS / NS_PER_S / SUBSTEPS)
    return np.linalg.matrix_power(small, SUBSTEPS)


def _density(over_db: Array, spread_db: float) -> Array:
    return np.asarray(np.exp(-0.5 * (over_db / spread_db) ** 2) / spread_db)


def _moments(weight: Array, value: Array) -> tuple[float, float]:
    mean = float(weight @ value)
    variance = float(weight @ (value - mean) ** 2)
    return mean, math.sqrt(max(0.0, variance))
