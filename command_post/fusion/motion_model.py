"""How a stride moves a particle."""

from __future__ import annotations

import math
from typing import Annotated, TypeAlias

import msgspec
import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from shared.messages import OdometryIncrement

Floats: TypeAlias = NDArray[np.float64]
Noise: TypeAlias = Annotated[float, Meta(ge=0.0, le=100.0)]

NORTH, EAST, OFFSET, DRIFT = range(4)
"""Rows of a particle state: metres north and east, heading offset φ and drift δφ in radians."""

MOST_TOLD_SD_M = 10.0
MOST_TOLD_SD_RAD = math.pi
MOST_LOST = 100


class MotionModel(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Process noise of one increment: standard deviations.

    North and east get ``position_sd_m`` + ``position_sd_per_m`` × the increment's length, and
    ``lost_sd_m`` for each increment that was lost before it; the two parts of the heading get
    ``offset_sd_rad`` and ``drift_sd_rad``. What the increment's own covariance says comes on top,
    so that a crawl may be told to be worse than a walk.
    """

    position_sd_m: Noise = 0.02
    position_sd_per_m: Noise = 0.05
    lost_sd_m: Noise = 1.0
    offset_sd_rad: Noise = math.radians(0.1)
    drift_sd_rad: Noise = math.radians(0.7)

    def position_noise_m(self, increment: OdometryIncrement, lost: int) -> float:
        """Return the standard deviation to add to north and to east, ``lost`` increments missed."""
        length_m = math.hypot(increment.d_north_m, increment.d_east_m)
        told_m2 = 0.5 * (increment.covariance[0] + increment.covariance[4])
        return math.hypot(
            self.position_sd_m + self.position_sd_per_m * length_m,
            self.lost_sd_m * min(lost, MOST_LOST),
            _root(told_m2, MOST_TOLD_SD_M),
        )

    def drift_noise_rad(self, increment: OdometryIncrement) -> float:
        """Return the standard deviation to add to the heading drift."""
        return math.hypot(self.drift_sd_rad, _root(increment.covariance[9], MOST_TOLD_SD_RAD))


def propagate(
    state: Floats,
    increment: OdometryIncrement,
    lost: int,
    model: MotionModel,
    generator: np.random.Generator,
) -> Floats:
    """Return the particle states (4, n) after ``increment``; rows are north, east, φ, δφ.

    The increment is in the agent's frame, whose north lies φ + δφ clockwise of the incident's;
    ``lost`` increments went missing before it. State equation of "Indoor location tracking for
    first responders using data network".
    """
    d_north, d_east = increment.d_north_m, increment.d_east_m
    noise = generator.standard_normal(state.shape)
    noise[:OFFSET] *= model.position_noise_m(increment, lost)
    noise[OFFSET] *= model.offset_sd_rad
    noise[DRIFT] *= model.drift_noise_rad(increment)
    error_rad = state[OFFSET] + state[DRIFT]
    cosine, sine = np.cos(error_rad), np.sin(error_rad)
    moved = state + noise
    # N ← N + ΔN·cos(φ + δφ) − ΔE·sin(φ + δφ)
    moved[NORTH] += d_north * cosine - d_east * sine
    # E ← E + ΔE·cos(φ + δφ) + ΔN·sin(φ + δφ)
    moved[EAST] += d_east * cosine + d_north * sine
    return moved


def _root(variance: float, most: float) -> float:
    """Return a told variance as a standard deviation that no sender can blow up."""
    return min(math.sqrt(max(variance, 0.0)), most)
