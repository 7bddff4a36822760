"""One walk past five DAPs, and its filter's models in vectorised numpy, for whoever runs them.

The models are those of ``command_post.fusion.cloud``, in double precision: a stride with correlated
noise, heading jumps and missed strides; Student-t likelihoods of five places; the moments told
after each stride. A library brings the particles, the weights and the resampling.
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from command_post.fusion.cloud.chance import responder_stream, step_key
from command_post.fusion.cloud.cloud import Step
from command_post.fusion.cloud.model import CloudModel, Mixture, Tie
from command_post.fusion.cloud.packing import step_row, tie_row
from tests.stride_world import stride

Floats: TypeAlias = NDArray[np.float64]

STRIDES = 250
PARTICLES = 1024
STRIDE_M = 1.2
RADIUS_M = 15.0
DOF = 4.0
AROUND_M = np.array([[3.0, 0.0], [-2.0, 2.0], [0.0, -3.0], [-2.0, -1.0], [1.0, 2.0]])
"""Where the five DAPs that are near stand about the walker, wherever that is."""
NEAR_SD_M = 4.0
DAP_COVARIANCE_M2 = (0.4, 0.1, 0.2)
SINCE_STRIDES = 0.5
"""How long before the end of the stride the DAPs were passed."""
MODEL = CloudModel()
START = Mixture(
    np.ones(1),
    np.array([[RADIUS_M, 0.0, 0.0, 0.0, 0.0]]),
    np.diag([0.25, 0.25, 0.25, 4e-4, 1e-6])[None],
)


class Stride(NamedTuple):
    """What a filter is told: displacement, its noise, and where the DAPs that are near stand.

    ``weighing`` is the inverse of the covariance over the degrees of freedom (nn, ne, ee).
    """

    displacement_m: Floats
    elapsed_s: float
    root: Floats
    jump_rad: float
    drift_walk_rad_s: float
    daps_m: Floats
    weighing: Floats


class Told(NamedTuple):
    """What a filter tells after a stride."""

    north_m: float
    east_m: float
    covariance_m2: Floats
    offset_rad: float
    offset_sd_rad: float


def truth_m() -> Floats:
    """Where the walker is at each stance (STRIDES + 1, 2): round and round a circle."""
    turns = np.arange(STRIDES + 1) * STRIDE_M / RADIUS_M
    return RADIUS_M * np.stack([np.cos(turns), np.sin(turns)], axis=1)


def steps() -> list[Step]:
    """The walk as the cloud takes it: a stride and five ties at a time."""
    stream, place = responder_stream(1, "r1"), truth_m()
    found = []
    for n, (start_m, end_m) in enumerate(pairwise(place)):
        d_north, d_east = (end_m - start_m).tolist()
        increment = stride(float(n), d_north, d_east, sequence=n)
        since_m = (SINCE_STRIDES * d_north, SINCE_STRIDES * d_east)
        daps_m = (end_m - since_m + AROUND_M).tolist()
        ties = [
            Tie(north, east, DAP_COVARIANCE_M2, NEAR_SD_M, DOF, since_m) for north, east in daps_m
        ]
        found.append(Step(step_key(stream, n), increment, 0, ties))
    return found


def strides() -> list[Stride]:
    """The same walk as the numpy models take it."""
    found = []
    for step in steps():
        row = step_row(step.increment, 0, PARTICLES, MODEL)
        root = np.zeros((3, 3))
        root[np.tril_indices(3)] = row[3:9]
        daps_m = np.array([(tie.north_m, tie.east_m) for tie in step.ties])
        weighing = np.array(tie_row(step.ties[0], (0.0, 0.0))[4:7])
        found.append(Stride(np.array(row[:2]), row[2], root, row[9], row[12], daps_m, weighing))
    return found


def started(rng: np.random.Generator) -> Floats:
    """Draw PARTICLES states (5, n): north, east, φ, log-scale, drift."""
    sds: Floats = np.sqrt(np.diagonal(START.covariances[0]))
    drawn: Floats = START.means[0][:, None] + sds[:, None] * rng.standard_normal((5, PARTICLES))
    return drawn


def moved(state: Floats, told: Stride, rng: np.random.Generator) -> Floats:
    """Move states (5, n) by a stride."""
    normal = rng.standard_normal((4, state.shape[1]))
    happening = rng.random(state.shape[1])
    north, east, turned = told.root @ normal[:3]
    turned += (
        np.where(happening < MODEL.jump_share, told.jump_rad - told.root[2, 2], 0.0) * normal[2]
    )
    count = np.where(happening > 1.0 - MODEL.missed_share, 2.0, 1.0)
    north += count * told.displacement_m[0]
    east += count * told.displacement_m[1]
    scale = np.exp(state[3])
    cosine, sine = scale * np.cos(state[2]), scale * np.sin(state[2])
    after = state.copy()
    after[0] += cosine * north - sine * east
    after[1] += sine * north + cosine * east
    after[4] += told.drift_walk_rad_s * normal[3]
    after[2] += after[4] * told.elapsed_s + turned
    return after


def log_likelihood(state: Floats, told: Stride) -> Floats:
    """Return the log-likelihood (n,) of the five DAPs, but for what all particles share."""
    d_north, d_east = SINCE_STRIDES * told.displacement_m
    scale = np.exp(state[3])
    cosine, sine = scale * np.cos(state[2]), scale * np.sin(state[2])
    u = state[0] - (cosine * d_north - sine * d_east) - told.daps_m[:, 0, None]
    v = state[1] - (sine * d_north + cosine * d_east) - told.daps_m[:, 1, None]
    nn, ne, ee = told.weighing
    total: Floats = np.log1p(u * (nn * u + ne * v) + ee * v * v).sum(axis=0)
    return -0.5 * (DOF + 2.0) * total


def loosened(state: Floats, rng: np.random.Generator) -> Floats:
    """Scatter drift and log-scale of states (5, n) just resampled; mean and variance stay."""
    kept = MODEL.kept_spread
    fixed = state[3:]
    mean, sd = fixed.mean(axis=1, keepdims=True), fixed.std(axis=1, keepdims=True)
    scatter = math.sqrt(1.0 - kept**2) * sd * rng.standard_normal(fixed.shape)
    return np.concatenate([state[:3], kept * fixed + (1.0 - kept) * mean + scatter])


def summed_up(state: Floats, weights: Floats) -> Told:
    """Return the moments of states (5, n) whose weights sum to one."""
    place = state[:2] @ weights
    off = state[:2] - place[:, None]
    covariance = (weights * off) @ off.T
    cosine, sine = float(np.cos(state[2]) @ weights), float(np.sin(state[2]) @ weights)
    length = min(max(math.hypot(cosine, sine), 1e-9), 1.0)
    north_m, east_m = place.tolist()
    return Told(
        north_m, east_m, covariance, math.atan2(sine, cosine), math.sqrt(-2.0 * math.log(length))
    )
