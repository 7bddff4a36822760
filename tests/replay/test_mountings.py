"""Real recordings, turned as if the sensor had been worn otherwise: the same walk comes out."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from edge_agent.inertial.activity import ActivityClassifier
from edge_agent.inertial.eskf_parameters import EskfParameters
from edge_agent.mounts.boot_eskf import EskfBootMount
from edge_agent.mounts.interface import Increment
from edge_agent.sources.npz_set import read_npz_set
from edge_agent.sources.recording import Recording

Array = NDArray[np.float64]

CLIPS_NOWHERE = EskfParameters(flat_top_floor_rad_s=math.inf)
"""What a sensor clips, it clips along its own axes: turned afterwards, that is no longer so."""

ODD = {
    f"odd {index}": Rotation.from_rotvec(vector).as_matrix()
    for index, vector in enumerate([(0.3, 0.5, -0.7), (2.0, 1.0, 0.5), (0.6, 0.6, 0.6)])
}


def square_mountings() -> dict[str, Array]:
    """The 24 ways in which axes can point along axes."""
    found = {}
    for axes in itertools.permutations(range(3)):
        for signs in itertools.product((1.0, -1.0), repeat=3):
            matrix = np.zeros((3, 3))
            matrix[range(3), axes] = signs
            if np.linalg.det(matrix) > 0.0:
                name = " ".join("+-"[s < 0] + "xyz"[a] for a, s in zip(axes, signs, strict=True))
                found[name] = matrix
    return found


SQUARE = square_mountings()


def turned(recording: Recording, matrix: Array) -> Recording:
    def turn(vectors: Array) -> Array:
        return np.ascontiguousarray(vectors @ matrix.T)

    return replace(
        recording,
        force_m_s2=turn(recording.force_m_s2),
        rate_rad_s=turn(recording.rate_rad_s),
        field_ut=None if recording.field_ut is None else turn(recording.field_ut),
    )


def follow(
    recording: Recording, parameters: EskfParameters | None = None
) -> tuple[list[Increment], str | None]:
    mount = EskfBootMount(parameters)
    return mount.steps(recording) + mount.finish(), mount.worn


def assert_same(made: list[Increment], usual: list[Increment]) -> None:
    assert [i.end_time_ns for i in made] == [i.end_time_ns for i in usual]
    for one, other in zip(made, usual, strict=True):
        assert one.displacement_m == pytest.approx(other.displacement_m, abs=1e-9)
        assert one.d_heading_rad == pytest.approx(other.d_heading_rad, abs=1e-9)
        assert math.cos(one.heading_rad - other.heading_rad) == pytest.approx(1.0, abs=1e-12)
        assert one.facing_sd_rad == pytest.approx(other.facing_sd_rad, abs=1e-9)
        assert one.covariance == pytest.approx(other.covariance, abs=1e-9)


@pytest.fixture(params=["walk_33", "mixed_54"], scope="module")
def recording(request: pytest.FixtureRequest, data_dir: Path) -> Recording:
    """A walk with a magnetometer, and a run beyond the gyro's range without."""
    return read_npz_set(data_dir / "foot_strides" / f"{request.param}.npz").recording


@pytest.fixture(scope="module")
def usual(recording: Recording) -> list[Increment]:
    return follow(recording)[0]


@pytest.mark.parametrize("mounting", SQUARE)
def test_any_square_mounting_gives_the_same_strides(
    recording: Recording, usual: list[Increment], mounting: str
) -> None:
    made, words = follow(turned(recording, SQUARE[mounting]))
    assert_same(made, usual)
    assert words is not None


@pytest.mark.parametrize("mounting", ODD)
def test_any_odd_mounting_gives_the_same_strides(recording: Recording, mounting: str) -> None:
    made, _ = follow(turned(recording, ODD[mounting]), CLIPS_NOWHERE)
    assert_same(made, follow(recording, CLIPS_NOWHERE)[0])


def activities(recording: Recording) -> list[str]:
    mount, classifier = EskfBootMount(CLIPS_NOWHERE), ActivityClassifier()
    named: list[str] = []
    for sample in recording:
        classifier.take_sample(sample)
        increment = mount.step(sample)
        if increment is not None:
            named.append(classifier.take_increment(increment).activity)
    return named


@pytest.mark.parametrize("mounting", [*list(SQUARE)[::5], *ODD])
def test_any_mounting_gives_the_same_activities(data_dir: Path, mounting: str) -> None:
    recording = read_npz_set(data_dir / "foot_vicon" / "2017-11-27-11-14-52.npz").recording
    made = activities(turned(recording, {**SQUARE, **ODD}[mounting]))
    assert made == activities(recording)
    assert len(made) > 5
