"""One responder's track: a cloud of particles that strides move and DAPs tie down."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections import deque
from typing import NamedTuple

import numpy as np

from command_post.fusion.particle_filter import (
    effective_count,
    moments,
    predict,
    resample,
    spread,
    update,
)
from command_post.fusion.settings import FusionSettings
from shared.maths.angles import wrap_rad
from shared.messages import (
    FloorShare,
    LocalPosition,
    OdometryIncrement,
    Outline,
    TrackStart,
    TrackStatus,
)

REMEMBERED = 4096
"""Estimates and increments kept of a track: over an hour of strides."""

MOST_COORDINATE_M = 1e6
MOST_COVARIANCE_M2 = 1e12


class Estimate(NamedTuple):
    """Where a responder is held to be at ``time_ns``: what a ``TrackEstimate`` says of it.

    ``covariance_m2`` is horizontal (nn, ne, ee). What the published filter does not know has a
    default.
    """

    time_ns: int
    north_m: float
    east_m: float
    down_m: float
    covariance_m2: tuple[float, float, float]
    heading_rad: float
    heading_sd_rad: float
    last_proximity_time_ns: int | None
    down_sd_m: float | None = None
    regions_m: tuple[Outline, ...] = ()
    floors: tuple[FloorShare, ...] = ()
    status: TrackStatus = "tracking"
    reason: str = ""

    @property
    def position(self) -> LocalPosition:
        """The same place, as messages carry it."""
        return LocalPosition(
            north_m=self.north_m,
            east_m=self.east_m,
            down_m=self.down_m,
            covariance_m2=self.covariance_m2,
        )


class Track:
    """A particle filter fed with one responder's strides and proximities, in the order of time.

    It begins at ``position``. ``start`` is the responder's own, or ``None`` for one who is heard
    without: their heading may be any. The heading offset of the agent's frame is in the particles;
    height is the sum of the increments' heights.
    """

    def __init__(
        self,
        responder_id: str,
        start: TrackStart | None,
        position: LocalPosition,
        time_ns: int,
        settings: FusionSettings,
    ) -> None:
        self._settings = settings
        self._generator = _generator(settings.seed, responder_id)
        self._particles = spread(
            position,
            math.pi if start is None else start.heading_sd_rad,
            settings.start_drift_sd_rad,
            settings.particles,
            self._generator,
        )
        self.started_ns = None if start is None else start.event_time_ns
        self._time_ns = time_ns
        self._down_m = position.down_m
        self._agent_heading_rad: float | None = None
        self._last_proximity_ns: int | None = None
        self._sequence: int | None = None
        self._moved_ns = time_ns
        self._walked_m = 0.0
        self._tied_at_m: dict[str, float] = {}
        self._increments: deque[OdometryIncrement] = deque(maxlen=REMEMBERED)
        self._estimates: deque[Estimate] = deque(maxlen=REMEMBERED)
        self._remember()

    @property
    def estimate(self) -> Estimate:
        """The newest estimate."""
        return self._estimates[-1]

    def estimate_at(self, time_ns: int) -> Estimate:
        """Return the last estimate not after ``time_ns``, or the oldest still remembered."""
        found = bisect_right(self._estimates, time_ns, key=lambda estimate: estimate.time_ns)
        return self._estimates[max(found - 1, 0)]

    def moved_after(self, time_ns: int) -> list[OdometryIncrement]:
        """Return the increments still remembered that ended after ``time_ns``, as they came."""
        return [each for each in self._increments if each.event_time_ns > time_ns]

    def move(self, increment: OdometryIncrement) -> int:
        """Move by ``increment``; return how many were lost just before it.

        One that comes late moves the track all the same, for strides add up. What has a higher
        number is newer, so that a clock that was set back is followed, and what is later is too,
        for a unit that begins anew numbers from 0.
        """
        newest = (
            self._sequence is None
            or increment.sequence > self._sequence
            or increment.event_time_ns > self._moved_ns
        )
        lost = 0 if self._sequence is None else max(increment.sequence - self._sequence - 1, 0)
        self._particles = predict(
            self._particles, increment, lost, self._settings.motion, self._generator
        )
        if newest:
            self._sequence = increment.sequence
            self._agent_heading_rad = increment.heading_rad
            self._time_ns = self._moved_ns = increment.event_time_ns
        self._down_m += increment.d_down_m
        self._walked_m += math.hypot(increment.d_north_m, increment.d_east_m)
        self._increments.append(increment)
        self._remember()
        return lost

    def tie(self, dap_id: str, dap: LocalPosition, time_ns: int) -> bool:
        """Weigh in that the responder was near ``dap`` at ``time_ns``.

        ``False`` if that contradicts every particle, which are then kept as they are.
        """
        model = self._settings.proximity
        moved_m = self._walked_m - self._tied_at_m.get(dap_id, -math.inf)
        if moved_m >= model.again_after_m:
            north, east = self._particles.state[:2]
            likelihood = model.log_likelihood(north, east, dap.north_m, dap.east_m)
            weighted = update(self._particles, likelihood)
            if weighted is None:
                return False
            if effective_count(weighted) <= self._settings.resample_below * north.size:
                weighted = resample(weighted, self._settings.scheme, self._generator)
            self._particles = weighted
            self._tied_at_m[dap_id] = self._walked_m
        self._time_ns = max(self._time_ns, time_ns)
        self._last_proximity_ns = max(time_ns, self._last_proximity_ns or 0)
        self._remember()
        return True

    def _remember(self) -> None:
        while self._estimates and self._estimates[-1].time_ns > self._time_ns:
            self._estimates.pop()
        cloud = moments(self._particles)
        agent_heading_rad = self._agent_heading_rad
        nn, ne, ee = cloud.covariance_m2
        self._estimates.append(
            Estimate(
                time_ns=self._time_ns,
                north_m=within(cloud.north_m, MOST_COORDINATE_M),
                east_m=within(cloud.east_m, MOST_COORDINATE_M),
                down_m=within(self._down_m, MOST_COORDINATE_M),
                covariance_m2=told_covariance(nn, ne, ee),
                heading_rad=wrap_rad((agent_heading_rad or 0.0) + cloud.heading_error_rad),
                heading_sd_rad=math.pi if agent_heading_rad is None else cloud.heading_sd_rad,
                last_proximity_time_ns=self._last_proximity_ns,
            )
        )


def _generator(seed: int, responder_id: str) -> np.random.Generator:
    """Return the random numbers of one responder, which nobody else's messages can shift."""
    words = np.random.SeedSequence([seed, *responder_id.encode()])
    return np.random.Generator(np.random.Philox(words))


def origin(sd_m: float) -> LocalPosition:
    """Return the incident's origin, give or take ``sd_m`` each way."""
    return LocalPosition(north_m=0.0, east_m=0.0, down_m=0.0, covariance_m2=(sd_m**2, 0.0, sd_m**2))


def told_covariance(nn: float, ne: float, ee: float) -> tuple[float, float, float]:
    """Return a covariance (nn, ne, ee) as far as a message can carry it."""
    return (
        within(nn, MOST_COVARIANCE_M2),
        within(ne, MOST_COVARIANCE_M2),
        within(ee, MOST_COVARIANCE_M2),
    )


def within(value: float, bound: float) -> float:
    """Return ``value``, or the bound that it is beyond."""
    return value if -bound < value < bound else min(max(value, -bound), bound)
