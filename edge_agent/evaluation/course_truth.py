"""What is known of a walk or a drive other than a boot's stances: steps, way-points, speed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from edge_agent.evaluation.truth import Array, Truth
from edge_agent.evaluation.vehicle_mountings import Slip
from edge_agent.mounts.interface import Increment
from edge_agent.sources.recording import Recording
from shared.units import NS_PER_S

ARRIVED_S = 2.0


@dataclass(frozen=True)
class StepCount:
    """Steps of both feet: ``count`` (k,) have been taken by ``time_s`` (k,), neither ever falling.

    ``distance_m`` is the length of the way, where that is known, ``by_feet`` how many steps sensors
    on the feet tell, and ``contradictions`` how often one step counted cannot follow another.
    """

    time_s: Array
    count: Array
    distance_m: float | None = None
    by_feet: int | None = None
    contradictions: int | None = None

    @property
    def steps(self) -> int:
        """How many steps were taken between the first and the last moment."""
        return round(float(self.count[-1] - self.count[0]))


@dataclass(frozen=True)
class Waypoints:
    """Places passed: ``position_m`` (k, 2), north and east, at ``time_s`` (k,), rising.

    North is wherever the truth's frame has it. ``steps`` where they were counted as well.
    """

    time_s: Array
    position_m: Array
    steps: StepCount | None = None

    @property
    def length_m(self) -> float:
        """Length of the way from point to point, straight."""
        return float(np.linalg.norm(np.diff(self.position_m, axis=0), axis=1).sum())

    def at(self, time_s: Array) -> Array:
        """Return places (n, 2) at ``time_s`` (n,): evenly from point to point, held beyond."""
        return np.column_stack([np.interp(time_s, self.time_s, axis) for axis in self.position_m.T])


@dataclass(frozen=True)
class DrivenSpeed:
    """``speed_m_s`` (k,) of a vehicle at ``time_s`` (k,), rising."""

    time_s: Array
    speed_m_s: Array


def arrived_at(time_s: Array, rested_s: float) -> int:
    """Return which of one or more moments is the last before a rest, in the later half."""
    rests = np.diff(time_s) > rested_s
    rests[: len(rests) // 2] = False
    return int(np.argmax(rests)) if rests.any() else len(time_s) - 1


def out_and_back(truth: StepCount) -> Waypoints | None:
    """Return where who walked ``distance_m``, out and back, landed; ``None`` if it is not known.

    Every step is taken to be as long as the others, and the middle one to turn; steps in the later
    half after a rest of ``ARRIVED_S`` are of who has arrived and turns about.
    """
    if truth.distance_m is None or not truth.steps:
        return None
    arrived = arrived_at(truth.time_s, ARRIVED_S)
    steps = truth.count - truth.count[0]
    gone_m = truth.distance_m * np.minimum(steps / steps[arrived], 1.0)
    north_m = 0.5 * truth.distance_m - np.abs(0.5 * truth.distance_m - gone_m)
    return Waypoints(truth.time_s, np.column_stack((north_m, np.zeros(len(north_m)))), truth)


def out_along(increments: Sequence[Increment]) -> Waypoints:
    """Return how far along its line a boot was that went out and back: at each stride's two ends.

    ``increments`` are one or more, in order. The line leads from the start to the farthest stance;
    what the boot, or its heading, strays from it is left out. Nothing is scaled: a tape says where
    the mark was, the boot where they turned.
    """
    ends_m = np.cumsum([one.displacement_m[:2] for one in increments], axis=0)
    farthest_m = ends_m[np.argmax(np.hypot(*ends_m.T))]
    along_m = np.append(0.0, ends_m @ farthest_m / max(float(np.hypot(*farthest_m)), 1e-9))
    time_ns = np.array([(one.start_time_ns, one.end_time_ns) for one in increments])
    north_m = np.column_stack((along_m[:-1], along_m[1:])).ravel()
    return Waypoints(time_ns.ravel() / NS_PER_S, np.column_stack((north_m, np.zeros(len(north_m)))))


def stances_between(flights_s: Array) -> Array:
    """Return when a foot stood (k + 1,) that flew as ``flights_s`` (k, 2) says: midway between.

    Before the first flight and after the last, that is as it left, and as it landed.
    """
    middles_s = 0.5 * (flights_s[:-1, 1] + flights_s[1:, 0])
    return np.concatenate((flights_s[:1, 0], middles_s, flights_s[-1:, 1]))


@dataclass(frozen=True, eq=False)
class FixedDrive:
    """A drive as a sensor read it that was fixed to the car, forward-right-down, and its speed."""

    samples: Recording
    speed: DrivenSpeed


@dataclass(frozen=True, eq=False)
class MountedDrive:
    """The same drive with the sensor lying otherwise, and slipping at known times."""

    fixed: FixedDrive
    slips: tuple[Slip, ...]


MountTruth: TypeAlias = Truth | StepCount | Waypoints | DrivenSpeed | MountedDrive
"""What may be known of a recording; ``Truth`` is that of a boot's stances."""
