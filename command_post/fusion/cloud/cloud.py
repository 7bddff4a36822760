"""A responder's cloud and what can be done to it. Nothing here writes to a cloud it is given."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import msgspec
import numpy as np

from command_post.fusion.cloud.chance import Key
from command_post.fusion.cloud.kernels import run_steps, spawn_particles, weighted_places
from command_post.fusion.cloud.layout import (
    BLOCK,
    EFFECTIVE,
    LANES,
    LOG_EVIDENCE,
    MEAN_EAST,
    MEAN_NORTH,
    MEAN_OFFSET,
    OFFSET_SD,
    RESAMPLED,
    STEP_WIDTH,
    SUMMARY_WIDTH,
    TIE_WIDTH,
    VAR_EE,
    VAR_NE,
    VAR_NN,
    Counts,
    Keys,
    Lanes,
)
from command_post.fusion.cloud.model import CloudModel, Mixture, Tie
from command_post.fusion.cloud.packing import component_rows, step_row, tie_row
from shared.messages import OdometryIncrement

DEFAULT_MODEL = CloudModel()
_ANY_KEY = Key(0, 0)


class Cloud(NamedTuple):
    """Weighted particles in blocks (layout.py), their places relative to ``origin_m``."""

    lanes: Lanes
    origin_m: tuple[float, float]

    @property
    def particle_count(self) -> int:
        """How many particles there are."""
        return self.lanes.size // BLOCK * LANES


class Step(NamedTuple):
    """What befalls a cloud at once: an increment, if any, then ties, then resampling if needed.

    ``lost`` increments are known to have gone missing before it.
    """

    key: Key
    increment: OdometryIncrement | None = None
    lost: int = 0
    ties: Sequence[Tie] = ()


class Moments(NamedTuple):
    """A cloud summed up: mean place, its covariance (nn, ne, ee), and the heading offset φ.

    ``effective_count`` is 1 / Σw². ``log_evidence`` is the logarithm of the probability density
    (m⁻² for each tie) that the cloud gave to the step's ties before it took them in: two clouds
    of one responder compare by its sum. Both tell of the moment before the step's resampling.
    """

    north_m: float
    east_m: float
    covariance_m2: tuple[float, float, float]
    offset_rad: float
    offset_sd_rad: float
    effective_count: float
    log_evidence: float
    resampled: bool


class Packed(NamedTuple):
    """Steps as the kernels read them (layout.py)."""

    steps: Lanes
    keys: Keys
    ties: Lanes
    tie_ends: Counts


def spawn(mixture: Mixture, count: int, key: Key) -> Cloud:
    """Return a cloud of at least ``count`` particles, as many as fill whole blocks of 64.

    Raises ``ValueError`` for what is no mixture, or no count.
    """
    if count < 1:
        raise ValueError(f"a cloud needs at least one particle, not {count}")
    heaviest = np.asarray(mixture.means, np.float64)[int(np.argmax(mixture.weights))]
    origin_m = (float(np.floor(heaviest[0])), float(np.floor(heaviest[1])))
    rows = component_rows(mixture, origin_m)
    whole = -(-count // LANES) * LANES
    lanes = spawn_particles(whole, rows, np.uint32(key.low), np.uint32(key.high))
    return _frozen(lanes, origin_m)


def advance(
    cloud: Cloud, steps: Sequence[Step], model: CloudModel = DEFAULT_MODEL
) -> tuple[Cloud, list[Moments]]:
    """Return the cloud after ``steps``, and its moments at each.

    Many steps at once come to the same bits as one after another, at a fraction of the cost.
    """
    after, summaries = run(cloud, packed(cloud, steps, model))
    return after, told_by(summaries, cloud.origin_m)


def packed(cloud: Cloud, steps: Sequence[Step], model: CloudModel = DEFAULT_MODEL) -> Packed:
    """Lay out ``steps`` for clouds of this one's size and origin, to be run once or again."""
    size = cloud.particle_count
    rows = [step_row(step.increment, step.lost, size, model) for step in steps]
    ties = [tie_row(tie, cloud.origin_m) for step in steps for tie in step.ties]
    return Packed(
        np.array(rows, np.float32).reshape(-1, STEP_WIDTH),
        np.array([step.key for step in steps], np.uint32).reshape(-1, 2),
        np.array(ties, np.float32).reshape(-1, TIE_WIDTH),
        np.add.accumulate(np.array([len(step.ties) for step in steps], np.int64)),
    )


def run(cloud: Cloud, laid_out: Packed) -> tuple[Cloud, Lanes]:
    """Return the cloud after what was laid out, and summaries for ``told_by`` to read."""
    rows, keys, ties, tie_ends = laid_out
    summaries = np.empty((len(rows), SUMMARY_WIDTH), np.float32)
    lanes = run_steps(cloud.lanes, rows, keys, ties, tie_ends, summaries)
    return _frozen(lanes, cloud.origin_m), summaries


def told_by(summaries: Lanes, origin_m: tuple[float, float]) -> list[Moments]:
    """Return the moments that summaries (n, SUMMARY_WIDTH) of a cloud of this origin tell."""
    return [_moments(told, origin_m) for told in summaries.tolist()]


def move(
    cloud: Cloud,
    increment: OdometryIncrement,
    key: Key,
    lost: int = 0,
    model: CloudModel = DEFAULT_MODEL,
) -> Cloud:
    """Return the cloud moved by ``increment``, each particle by its own heading, scale and noise.

    The increment is in the agent's frame, whose north lies φ clockwise of the incident's.
    """
    return advance(cloud, (Step(key, increment, lost),), _without_resampling(model))[0]


def tie(cloud: Cloud, ties: Sequence[Tie]) -> tuple[Cloud, float]:
    """Return the cloud weighted by having been at places, and the logarithm of its evidence."""
    model = _without_resampling(DEFAULT_MODEL)
    tied, (told,) = advance(cloud, (Step(_ANY_KEY, ties=ties),), model)
    return tied, told.log_evidence


def resample(cloud: Cloud, key: Key, model: CloudModel = DEFAULT_MODEL) -> Cloud:
    """Return the cloud resampled systematically if its effective count is low, else itself."""
    drawn, (told,) = advance(cloud, (Step(key),), model)
    return drawn if told.resampled else cloud


def moments(cloud: Cloud) -> Moments:
    """Sum a cloud up. The heading is averaged on the circle (Mardia and Jupp 2000, section 2)."""
    model = _without_resampling(DEFAULT_MODEL)
    return advance(cloud, (Step(_ANY_KEY),), model)[1][0]


def places(cloud: Cloud) -> tuple[Lanes, Lanes, Lanes]:
    """Return metres north and east of the cloud's origin and weights, each (n,)."""
    north, east, weights = weighted_places(cloud.lanes)
    return north, east, weights


def to_bytes(cloud: Cloud) -> bytes:
    """Return the cloud as bytes, from which it resumes identically."""
    return np.array(cloud.origin_m, "<f8").tobytes() + cloud.lanes.astype("<f4").tobytes()


def from_bytes(saved: bytes) -> Cloud:
    """Return the cloud that was saved. Raises ``ValueError`` if the bytes are none."""
    if len(saved) < 16 + 4 * BLOCK or (len(saved) - 16) % (4 * BLOCK):
        raise ValueError(
            f"{len(saved)} bytes are no saved cloud: it was cut short, or is another's"
        )
    north_m, east_m = np.frombuffer(saved, "<f8", 2)
    lanes = np.frombuffer(saved, "<f4", offset=16).astype(np.float32)
    return _frozen(lanes, (float(north_m), float(east_m)))


def _without_resampling(model: CloudModel) -> CloudModel:
    return msgspec.structs.replace(model, resample_below=0.0)


def _moments(told: Sequence[float], origin_m: tuple[float, float]) -> Moments:
    return Moments(
        north_m=origin_m[0] + told[MEAN_NORTH],
        east_m=origin_m[1] + told[MEAN_EAST],
        covariance_m2=(told[VAR_NN], told[VAR_NE], told[VAR_EE]),
        offset_rad=told[MEAN_OFFSET],
        offset_sd_rad=told[OFFSET_SD],
        effective_count=told[EFFECTIVE],
        log_evidence=told[LOG_EVIDENCE],
        resampled=bool(told[RESAMPLED]),
    )


def _frozen(lanes: Lanes, origin_m: tuple[float, float]) -> Cloud:
    lanes.flags.writeable = False
    return Cloud(lanes, origin_m)
