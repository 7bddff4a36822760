"""What every mount does: inertial samples in, odometry increments out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol, runtime_checkable

from edge_agent.inertial.heading import UNKNOWN_HEADING_SD_RAD
from edge_agent.inertial.linear_zupt import PathPoint
from edge_agent.inertial.stride_error import Covariance4
from edge_agent.sources.recording import Recording
from shared.maths.rotations import Vector3
from shared.messages import Activity, ImuSample


class Increment(NamedTuple):
    """Movement between two moments, in the agent's own level frame.

    ``displacement_m`` is north, east, down, from ``start_time_ns`` to ``end_time_ns``; before the
    start, and until the next increment starts, the wearer stands. ``heading_rad`` is how they face
    at the end, ``facing_sd_rad`` how well it is known how the sensor is worn, and so how they face
    once the frame is given. ``d_heading_rad`` is how far they turned since the last increment's
    end, standing included; what was learnt meanwhile of how the sensor is worn is not in it, and
    the covariance is of it. ``path`` is the way between, point by point from the start, for whoever
    scores it; empty where the displacement is not known. ``carried_down_m``, of the displacement,
    was a lift's. ``steps`` is how many steps it is of which at least the length is known, a boot's
    stride being one; ``activity`` what the wearer did, where the mount itself can tell.
    """

    start_time_ns: int
    end_time_ns: int
    displacement_m: Vector3
    d_heading_rad: float
    heading_rad: float
    covariance: Covariance4
    path: Sequence[PathPoint]
    carried_down_m: float = 0.0
    facing_sd_rad: float = UNKNOWN_HEADING_SD_RAD
    steps: int = 1
    activity: Activity | None = None


@dataclass
class Faults:
    """Samples that were not as they should be, counted since the mount was made."""

    unusable: int = 0
    out_of_order: int = 0
    gaps: int = 0
    restarts: int = 0


class Mount(Protocol):
    """A way to wear the sensor, and a method to read it. Plain state: a copy resumes alike."""

    faults: Faults

    @property
    def ready(self) -> bool:
        """Whether the sensor has been still once, so that the wearer may set out."""

    @property
    def heading_rad(self) -> float:
        """How the wearer faces, in the agent's level frame."""

    @property
    def heading_sd_rad(self) -> float:
        """How well the heading was known as the wearer set out."""

    @property
    def worn(self) -> str | None:
        """How the sensor was found to be worn, in words; ``None`` as long as it was not."""

    def step(self, sample: ImuSample) -> Increment | None:
        """Take in the next sample; return the movement that it completes, if it does.

        Never raises: a sample that is not finite, or not later than the last, is counted in
        ``faults`` and passed over.
        """

    def steps(self, samples: Recording) -> list[Increment]:
        """Take in samples in order; return what :meth:`step` returns for each, in that order.

        The mount is left as by single steps, to the bit.
        """

    def finish(self) -> list[Increment]:
        """Return the movements that were still being waited for: no more samples will come."""


@runtime_checkable
class TakesSpeed(Protocol):
    """What a vehicle's mount has beyond the others."""

    def know_speed(self, speed_m_s: float, sd_m_s: float) -> None:
        """Take in a speed that somebody knows at this moment."""
