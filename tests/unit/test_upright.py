"""The linear method with a sensor worn any way up."""

from __future__ import annotations

import math

import numpy as np
import pytest

from edge_agent.mounts.boot import BootMount
from edge_agent.mounts.interface import Increment
from edge_agent.mounts.upright import UprightMount
from edge_agent.sources.recording import Recording
from shared.maths.rotations import Quaternion, Vector3, from_rotation_vector, rotate
from shared.messages import ImuSample
from tests.synthetic_boot import BROKEN_READINGS, SyntheticWalk

WALK = SyntheticWalk(heading_rad=-2.0, turn_rad=0.2, rise_m=0.1, field_ut=(22.0, 0.0, 41.0))
QUARTER_RAD = 0.5 * math.pi
MOUNTINGS: dict[str, Vector3] = {
    "on its left side": (-QUARTER_RAD, 0.0, 0.0),
    "on its right side": (QUARTER_RAD, 0.0, 0.0),
    "upside down": (math.pi, 0.0, 0.0),
    "on its nose": (0.0, -QUARTER_RAD, 0.0),
    "odd": (1.0, 1.2, -0.4),
}


def worn(sample: ImuSample, turn: Quaternion) -> ImuSample:
    return ImuSample(
        sample.time_ns,
        rotate(turn, sample.force_m_s2),
        rotate(turn, sample.rate_rad_s),
        None if sample.field_ut is None else rotate(turn, sample.field_ut),
    )


def samples(mounting: str | None = None) -> list[ImuSample]:
    turn = from_rotation_vector(MOUNTINGS[mounting] if mounting else (0.0, 0.0, 0.0))
    return [worn(sample, turn) for sample in WALK.samples(100.0)]


def follow(mount: UprightMount | BootMount, taken: list[ImuSample]) -> list[Increment]:
    found = [found for sample in taken if (found := mount.step(sample)) is not None]
    return found + mount.finish()


@pytest.mark.parametrize("mounting", MOUNTINGS)
def test_the_same_strides_come_out_however_it_is_worn(mounting: str) -> None:
    mount = UprightMount(BootMount())
    made = follow(mount, samples(mounting))
    strides_m = np.diff(np.array(WALK.stance_places_m), axis=0)
    assert len(made) == WALK.strides
    for increment, stride_m in zip(made, strides_m, strict=True):
        np.testing.assert_allclose(increment.displacement_m, stride_m, atol=0.03)
        assert increment.d_heading_rad == pytest.approx(WALK.turn_rad, abs=0.02)
    assert mount.worn is not None


def test_a_sensor_near_upright_is_read_as_it_is() -> None:
    mount = UprightMount(BootMount())
    assert follow(mount, samples()) == follow(BootMount(), samples())
    assert mount.worn is None


def test_a_batch_gives_what_samples_one_by_one_give() -> None:
    taken = samples("odd")
    recording = Recording(
        np.array([sample.time_ns for sample in taken]),
        np.array([sample.force_m_s2 for sample in taken]),
        np.array([sample.rate_rad_s for sample in taken]),
        np.array([sample.field_ut for sample in taken]),
    )
    mount = UprightMount(BootMount())
    batch = mount.steps(recording) + mount.finish()
    for one, other in zip(batch, follow(UprightMount(BootMount()), taken), strict=True):
        assert one.end_time_ns == other.end_time_ns
        assert one.displacement_m == pytest.approx(other.displacement_m, abs=1e-9)


@pytest.mark.parametrize("broken", BROKEN_READINGS)
def test_broken_readings_at_the_start_do_no_harm(broken: str) -> None:
    bad = [ImuSample(t, *BROKEN_READINGS[broken]) for t in range(1, 30)]
    made = follow(UprightMount(BootMount()), bad + samples("upside down")[1:])
    assert len(made) == WALK.strides


def test_a_few_samples_or_weightless_ones_are_passed_on() -> None:
    few = UprightMount(BootMount())
    assert follow(few, samples("upside down")[:7]) == []
    falling = UprightMount(BootMount())
    still = [ImuSample(t * 10_000_000, (0.0, 0.0, 0.1), (0.0, 0.0, 0.0)) for t in range(60)]
    assert follow(falling, still) == []
    assert falling.worn is None
