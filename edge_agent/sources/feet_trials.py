"""Recordings of a trunk whose feet carry sensors of their own: each foot a boot, and a truth.

The way of a foot with a sensor is known stride by stride, far better than a trunk's steps tell it.
Of the foot itself that is no truth; of the other foot, and of the trunk between both, it is.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache
from itertools import pairwise
from pathlib import Path
from typing import Literal, NamedTuple, TypeAlias

import numpy as np
import structlog
from numpy.typing import NDArray

from edge_agent.evaluation.course_truth import StepCount, Waypoints, out_along, stances_between
from edge_agent.mounts.boot_eskf import EskfBootMount
from edge_agent.mounts.interface import Increment
from edge_agent.sources.npz_set import FLIGHT_RATE_HZ, SENSORS, flights_of, read_npz_set
from edge_agent.sources.recording import Array, Recording, SourceError, refuse_other_units
from shared.npz_file import NpzFileError, array_names, array_of, load_npz
from shared.units import NS_PER_S

Side: TypeAlias = Literal["left", "right"]

SIDES: tuple[Side, Side] = ("left", "right")

MOST_LOST_SHARE = 0.005
"""Of a foot's samples, which have no stamps of their own: when more were lost nobody knows."""

LEAST_STEP_M = 0.1
"""A foot that is set down nearer to where it stood has shifted its weight."""

RESTED_S = 1.3
"""After so long a walk has been interrupted."""

_log = structlog.stdlib.get_logger(__name__)


class _Foot(NamedTuple):
    """What a foot's sensor read, and when the foot stood by its marks (k,)."""

    samples: Recording
    stood_s: Array


class _Pair(NamedTuple):
    """Both feet, and the way of each as its own strides tell it."""

    feet: dict[Side, _Foot]
    ways: dict[Side, Waypoints]
    steps: int


def has_feet(path: Path) -> bool:
    """Whether the file at ``path`` holds what sensors on both feet read."""
    return {f"{side}_foot_acc_m_s2" for side in SIDES} <= array_names(path)


def whole_feet(path: Path) -> tuple[Side, ...]:
    """Return the feet of the recording at ``path`` that can be followed: both, or none and why."""
    try:
        for side in SIDES:
            _read(path, side)
    except SourceError as error:
        _log.warning("left out", reason=str(error))
        return ()
    return SIDES


def foot_beside(path: Path, side: Side) -> tuple[Recording, Waypoints]:
    """Return a foot's samples, and its true way: where the other foot was whenever it stood.

    A foot stands while the other swings past it, so half-way of the other's stride.
    """
    pair = _pair(path)
    other = pair.ways[SIDES[1 - SIDES.index(side)]]
    stood_s = pair.feet[side].stood_s
    return pair.feet[side].samples, Waypoints(stood_s, other.at(stood_s))


def trunk_between(path: Path) -> tuple[Recording, Waypoints]:
    """Return a trunk's samples, and its true way: between both feet, whenever either stood."""
    pair = _pair(path)
    stood_s = np.sort(np.concatenate([foot.stood_s for foot in pair.feet.values()]))
    between_m = np.mean([way.at(stood_s) for way in pair.ways.values()], axis=0)
    return read_npz_set(path).recording, Waypoints(stood_s, between_m)


def checked_by_feet(path: Path, recording: Recording, counted: StepCount) -> StepCount:
    """Return steps of a ``recording`` with what tells whether the marks on the feet are right.

    What the feet's own sensors tell as boots, if no samples of them are lost; and how often the
    marks have both feet in the air, or one fly twice without a rest while the other stands.
    Raises ``SourceError`` for marks that are none.
    """
    try:
        arrays = load_npz(path)
        time_s = recording.time_ns / NS_PER_S
        flights = {side: flights_of(path, arrays, side, time_s) for side in SIDES}
    except NpzFileError as error:
        raise SourceError(str(error)) from error
    try:
        by_feet = _pair(path).steps
    except SourceError:
        by_feet = None
    return replace(counted, by_feet=by_feet, contradictions=_contradictions(flights))


def _contradictions(flights: Mapping[Side, NDArray[np.int64]]) -> int:
    """Return how many flights (k, 2) cannot follow the one before, of either foot."""
    in_turn = sorted((*flight, side) for side in SIDES for flight in flights[side].tolist())
    rested = RESTED_S * FLIGHT_RATE_HZ
    return sum(
        left < landed or (side == next_side and left - landed < rested)
        for (_, landed, side), (left, _, next_side) in pairwise(in_turn)
    )


@lru_cache(maxsize=2)
def _pair(path: Path) -> _Pair:
    feet = {side: _read(path, side) for side in SIDES}
    strides = {side: _strides(path, foot.samples) for side, foot in feet.items()}
    lengths_m = [math.hypot(*one.displacement_m[:2]) for side in SIDES for one in strides[side]]
    steps = sum(length_m > LEAST_STEP_M for length_m in lengths_m)
    return _Pair(feet, {side: out_along(told) for side, told in strides.items()}, steps)


def _strides(path: Path, samples: Recording) -> list[Increment]:
    mount = EskfBootMount()
    increments = mount.steps(samples) + mount.finish()
    if not increments:
        raise SourceError(f"{path}: a foot in it makes no stride, which is no walk")
    return increments


def _read(path: Path, side: Side) -> _Foot:
    """Return one foot; raise ``SourceError`` if nobody knows when its samples were taken."""
    try:
        arrays = load_npz(path)
        # The trunk's stamps are those of the whole recording.
        time_s = read_npz_set(path).recording.time_ns / NS_PER_S
        force_m_s2 = arrays[f"{side}_foot_acc_m_s2"]
        count, due = len(force_m_s2), round(FLIGHT_RATE_HZ * (time_s[-1] - time_s[0])) + 1
        if abs(due - count) > MOST_LOST_SHARE * due:
            raise SourceError(
                f"{path}: {due - count} of {due} samples of the {side} foot are lost, and nobody "
                "knows which"
            )
        force_m_s2 = array_of(path, arrays, f"{side}_foot_acc_m_s2", (count, 3))
        rate_rad_s = array_of(path, arrays, f"{side}_foot_gyr_rad_s", (count, 3))
        flights = flights_of(path, arrays, side, time_s)
    except NpzFileError as error:
        raise SourceError(str(error)) from error
    refuse_other_units(path, force_m_s2, rate_rad_s, SENSORS)
    taken_s = np.linspace(time_s[0], time_s[-1], count)
    samples = Recording(np.round(NS_PER_S * taken_s).astype(np.int64), force_m_s2, rate_rad_s)
    return _Foot(samples, stances_between(time_s[0] + flights / FLIGHT_RATE_HZ))
