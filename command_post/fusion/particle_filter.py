"""Sampling, importance, resampling: one responder's belief as a cloud of weighted particles."""

from __future__ import annotations

import math
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from command_post.fusion.motion_model import DRIFT, EAST, NORTH, OFFSET, MotionModel, propagate
from command_post.fusion.resampling import Scheme
from command_post.fusion.resampling import resample as draw
from shared.maths.angles import wrap_rad
from shared.messages import LocalPosition, OdometryIncrement

Floats: TypeAlias = NDArray[np.float64]

VANISHED = -700.0
"""Natural logarithm below which a likelihood is nothing in double precision, all but exactly."""


class Particles(NamedTuple):
    """A cloud: ``state`` (4, n), rows north and east in m, φ and δφ in rad; ``log_weights`` (n,).

    The weights sum to one. Neither array is ever written to: each operation returns a new cloud.
    """

    state: Floats
    log_weights: Floats


class Moments(NamedTuple):
    """A cloud summed up: mean place, its covariance (nn, ne, ee), and the heading error φ + δφ."""

    north_m: float
    east_m: float
    covariance_m2: tuple[float, float, float]
    heading_error_rad: float
    heading_sd_rad: float


def spread(
    position: LocalPosition,
    heading_sd_rad: float,
    drift_sd_rad: float,
    count: int,
    generator: np.random.Generator,
) -> Particles:
    """Return ``count`` particles around ``position`` after its covariance, weighted alike.

    A covariance that none can be is taken as the nearest that can. The heading offset φ is spread
    by ``heading_sd_rad`` around nought, the drift δφ by ``drift_sd_rad``.
    """
    nn, ne, ee = position.covariance_m2
    lower_nn = math.sqrt(max(nn, 0.0))
    east_sd_m = math.sqrt(max(ee, 0.0))
    told_m = ne / lower_nn if lower_nn > 0.0 else 0.0
    lower_ne = min(max(told_m, -east_sd_m), east_sd_m)
    lower_ee = math.sqrt(max(east_sd_m**2 - lower_ne**2, 0.0))
    normal = generator.standard_normal((4, count))
    state = np.stack(
        [
            position.north_m + lower_nn * normal[NORTH],
            position.east_m + lower_ne * normal[NORTH] + lower_ee * normal[EAST],
            heading_sd_rad * normal[OFFSET],
            drift_sd_rad * normal[DRIFT],
        ]
    )
    return _frozen(state, _equal(count))


def predict(
    particles: Particles,
    increment: OdometryIncrement,
    lost: int,
    model: MotionModel,
    generator: np.random.Generator,
) -> Particles:
    """Move every particle by ``increment``, each with its own heading error and noise.

    ``lost`` increments are known to have gone missing before it.
    """
    moved = propagate(particles.state, increment, lost, model, generator)
    return _frozen(moved, particles.log_weights)


def update(particles: Particles, log_likelihood: Floats) -> Particles | None:
    """Weight every particle by a measurement's likelihood, (n,) natural logarithms.

    ``None`` if all weights vanish: the measurement contradicts every particle.
    """
    if not log_likelihood.max() > VANISHED:
        return None
    joint = particles.log_weights + log_likelihood
    peak = joint.max()
    return _frozen(particles.state, joint - (peak + math.log(np.exp(joint - peak).sum())))


def effective_count(particles: Particles) -> float:
    """How many particles of equal weight would be worth as much: 1 / Σw²."""
    return 1.0 / float(np.exp(2.0 * particles.log_weights).sum())


def resample(particles: Particles, scheme: Scheme, generator: np.random.Generator) -> Particles:
    """Draw the particles anew by weight; all weigh the same afterwards."""
    chosen = draw(np.exp(particles.log_weights), scheme, generator)
    return _frozen(particles.state[:, chosen], _equal(chosen.size))


def moments(particles: Particles) -> Moments:
    """Sum a cloud up. The heading is averaged on the circle (Mardia and Jupp 2000, section 2).

    Sums are numpy's own, never BLAS, whose order depends on the machine's threads.
    """
    weights = np.exp(particles.log_weights)
    north, east, offset, drift = particles.state
    mean_north = float((weights * north).sum())
    mean_east = float((weights * east).sum())
    off_north, off_east = north - mean_north, east - mean_east
    weighted_north = weights * off_north
    heading = offset + drift
    cosine = float((weights * np.cos(heading)).sum())
    sine = float((weights * np.sin(heading)).sum())
    length = min(max(math.hypot(cosine, sine), 1e-9), 1.0)
    return Moments(
        north_m=mean_north,
        east_m=mean_east,
        covariance_m2=(
            float((weighted_north * off_north).sum()),
            float((weighted_north * off_east).sum()),
            float((weights * off_east * off_east).sum()),
        ),
        heading_error_rad=wrap_rad(math.atan2(sine, cosine)),
        heading_sd_rad=math.sqrt(-2.0 * math.log(length)),
    )


def _equal(count: int) -> Floats:
    return np.full(count, -math.log(count))


def _frozen(state: Floats, log_weights: Floats) -> Particles:
    state.flags.writeable = False
    log_weights.flags.writeable = False
    return Particles(state, log_weights)
