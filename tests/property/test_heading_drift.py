"""The heading's filter: whatever it is given, its covariance is one, and no update doubts more."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from edge_agent.inertial.heading_drift import Correction, HeadingDrift
from shared.maths.rotations import Vector3, from_rotation_vector, to_matrix

angles = st.floats(-math.pi, math.pi)


class Field(NamedTuple):
    """What a magnetometer tells at one place."""

    north_ut: float
    east_ut: float
    rotation_rad: Vector3

    def observe(self, drift: HeadingDrift) -> Correction:
        """Let ``drift`` take it in."""
        level_from_sensor = np.array(to_matrix(from_rotation_vector(self.rotation_rad)))
        return drift.observe_field(np.array([self.north_ut, self.east_ut]), level_from_sensor[:2])


class Corridor(NamedTuple):
    """What a straight piece of the way tells."""

    off_rad: float
    sd_rad: float
    is_new: bool

    def observe(self, drift: HeadingDrift) -> Correction:
        """Let ``drift`` take it in."""
        if self.is_new:
            drift.reckon_direction(self.sd_rad)
        return drift.observe_direction(self.off_rad, self.sd_rad)


components_ut = st.floats(-100.0, 100.0)
fields = st.builds(Field, components_ut, components_ut, st.tuples(angles, angles, angles))
corridors = st.builds(Corridor, angles, st.floats(1e-3, 3.0), st.booleans())
walks = st.tuples(st.floats(0.0, 600.0), st.floats(0.0, 10.0), st.floats(0.0, 1e4))


@given(st.lists(st.tuples(walks, st.one_of(fields, corridors)), max_size=30))
def test_the_covariance_stays_one(
    happened: list[tuple[tuple[float, float, float], Field | Corridor]],
) -> None:
    drift = HeadingDrift()
    for walk, observed in happened:
        drift.predict(*walk)
        before_rad = drift.error_sd_rad
        correction = observed.observe(drift)
        assert drift.error_sd_rad <= before_rad * (1.0 + 1e-6) + 1e-9
        assert math.isfinite(correction.turn_rad)
        assert 0.0 <= correction.variance_rad2 <= before_rad**2 * (1.0 + 1e-6) + 1e-12
    covariance = drift.covariance
    np.testing.assert_allclose(covariance, covariance.T, rtol=1e-9, atol=1e-15)
    smallest, *_, largest = np.linalg.eigvalsh(covariance)
    assert smallest >= -1e-9 * largest
