"""A phone at the chest or in the hand, as published: an increment a step.

"A study on smartphone indoor navigation technology using extended Kalman filter": steps by an
adaptive threshold, Weinberg's length, heading by an extended Kalman filter. The heading is that of
the phone; which way it is held to the walk is taken not to change, and the gyro to have no bias.
"""

from __future__ import annotations

import math

from edge_agent.inertial.attitude_ekf import AttitudeEkf
from edge_agent.inertial.heading import UNKNOWN_HEADING_SD_RAD
from edge_agent.inertial.step_detection import AdaptiveThreshold
from edge_agent.inertial.step_length import weinberg_m
from edge_agent.mounts.intake import has_gyro
from edge_agent.mounts.interface import Increment
from edge_agent.mounts.published_steps import PublishedSteps
from edge_agent.mounts.step_increment import step_anywhere
from shared.messages import ImuSample


class PublishedChestMount(PublishedSteps):
    """Follows one phone; without a gyroscope steps are counted, and told as leading anywhere."""

    def __init__(self, step_scale: float = 1.0) -> None:
        super().__init__(step_scale, needs_gyro=False)
        self._threshold = AdaptiveThreshold()
        self._filter: AttitudeEkf | None = None

    @property
    def ready(self) -> bool:
        """Whether a sample has come: the paper asks for no more."""
        return self._last_ns is not None

    @property
    def heading_rad(self) -> float:
        """How the phone faces, from 0 at first."""
        return 0.0 if self._filter is None else self._filter.yaw_rad

    @property
    def heading_sd_rad(self) -> float:
        """Nothing tells it: the paper begins at 0."""
        return UNKNOWN_HEADING_SD_RAD

    def _restart(self) -> None:
        self._threshold = AdaptiveThreshold()

    def _take(self, sample: ImuSample, since_s: float) -> Increment | None:
        self._turn(sample, since_s)
        step = self._threshold.step(sample.time_ns, math.hypot(*sample.force_m_s2))
        if step is None:
            return None
        length_m = weinberg_m(step.highest_m_s2, step.lowest_m_s2)
        if self._filter is None:
            return step_anywhere(step, self._step_scale * length_m)
        return self._ahead(step, length_m)

    def _turn(self, sample: ImuSample, since_s: float) -> None:
        if not has_gyro(sample):
            return
        if self._filter is None:
            self._filter = AttitudeEkf(sample.force_m_s2)
        self._filter.predict(sample.rate_rad_s, since_s)
        self._filter.correct(sample.force_m_s2)
