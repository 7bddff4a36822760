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
from typing import Annotated, NamedTuple, TypeAlias

import msgspec
import numpy as np
from msgspec import Meta
from numpy.typing import NDArray
from scipy.linalg import expm

from shared.units import NS_PER_S

Array: TypeAlias = NDArray[np.float64]
Decibel: TypeAlias = Annotated[float, Meta(gt=0.0, le=60.0)]
Share: TypeAlias = Annotated[float, Meta(ge=0.0, lt=1.0)]
LogOdds: TypeAlias = Annotated[float, Meta(ge=-20.0, le=20.0)]

POWER_AT_1_M_DBM = -40.0
"""What an average radio gives over a clear metre, once ``offset_db`` has been added."""

STEP_NS = NS_PER_S // 10
"""Range changes in steps of this."""

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


class RangeSettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """What the filter takes radio and people to be like.

    Near is within ``near_m``; one comes near when the log odds of that are at least
    ``enter_log_odds``, and leaves when they are below ``leave_log_odds``. Power falls with range to
    the ``exponent``, readings spread by ``spread_db``, and say something new once in
    ``coherence_s``; the body takes ``body_loss_db`` of a ``body_share`` of them. Links differ by
    ``offset_sd_db``. From farther than ``far_m`` readings have the mean ``far_dbm`` and spread by
    ``far_spread_db``. Antennas are ``height_m`` apart in height, people spread out by
    ``diffusion_m2_s``, and nobody is farther than ``farthest_m``.
    """

    near_m: Annotated[float, Meta(ge=0.3, le=20.0)] = 2.5
    enter_log_odds: LogOdds = -1.0
    leave_log_odds: LogOdds = -2.0
    exponent: Annotated[float, Meta(ge=1.0, le=6.0)] = 2.2
    spread_db: Decibel = 6.0
    coherence_s: Annotated[float, Meta(gt=0.0, le=60.0)] = 1.0
    body_loss_db: Decibel = 10.0
    body_share: Share = 0.3
    offset_sd_db: Decibel = 3.0
    far_m: Annotated[float, Meta(ge=1.0, le=200.0)] = 11.0
    far_dbm: Annotated[float, Meta(ge=-200.0, le=100.0)] = -75.0
    far_spread_db: Decibel = 10.0
    height_m: Annotated[float, Meta(gt=0.0, le=10.0)] = 0.5
    diffusion_m2_s: Annotated[float, Meta(gt=0.0, le=100.0)] = 2.0
    farthest_m: Annotated[float, Meta(ge=1.0, le=200.0)] = 15.0

    def __post_init__(self) -> None:
        """Refuse odds that it takes more to keep than to reach, and a far that is near."""
        if self.leave_log_odds > self.enter_log_odds:
            raise ValueError("leave_log_odds: put it at or below enter_log_odds")
        if not 2.0 * self.near_m <= self.far_m < self.farthest_m:
            raise ValueError("far_m: put it between twice near_m and farthest_m")


class _Grid(NamedTuple):
    """Rings (n) by offsets (m): mean level and prior (n, m), and motion in 2^k steps (n, n)."""

    level_db: Array
    prior: Array
    motions: list[Array]
    is_far: NDArray[np.bool_]
    range_m: Array
    offset_db: Array


class Belief(NamedTuple):
    """What is held of somebody: the log odds that they are near, and moments.

    The range (m) and the link's offset (dB) are given by mean and standard deviation.
    """

    log_odds: float
    range_m: float
    range_sd_m: float
    offset_db: float
    offset_sd_db: float


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
    return np.asarray(expm(rate * (STEP_NS / NS_PER_S)))


def _density(over_db: Array, spread_db: float) -> Array:
    return np.asarray(np.exp(-0.5 * (over_db / spread_db) ** 2) / spread_db)


def _moments(weight: Array, value: Array) -> tuple[float, float]:
    mean = float(weight @ value)
    variance = float(weight @ (value - mean) ** 2)
    return mean, math.sqrt(max(0.0, variance))
