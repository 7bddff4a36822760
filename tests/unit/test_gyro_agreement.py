"""Forces and rates of one sensor turn alike; those of exchanged axes or other units do not."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from msgspec.structs import replace
from scipy.spatial.transform import Rotation

from edge_agent.mounts.interface import Faults
from edge_agent.self_check.checker import SelfCheck
from edge_agent.self_check.gyro_agreement import GyroAgreement
from shared.messages import ImuSample, Mount

RATE_HZ = 50.0
Fault = Callable[[np.ndarray], np.ndarray]


def walk(fault: Fault = np.array, *, turns_rad_s: float = 1.5) -> list[ImuSample]:
    """Return a minute of a sensor held askew by who sways, and turns about every ten seconds."""
    time_s = np.arange(0.0, 60.0, 1.0 / RATE_HZ)
    chance = np.random.default_rng(1)
    up = np.array([0.2, 0.5, math.sqrt(1.0 - 0.29)])
    turning = turns_rad_s * (time_s % 10.0 < 2.0)
    rate = turning[:, None] * up + chance.normal(0.0, 0.05, (len(time_s), 3))
    bounce = 9.81 + 3.0 * np.sin(2.0 * math.pi * 1.9 * time_s)
    force = bounce[:, None] * up + chance.normal(0.0, 0.5, (len(time_s), 3))
    return [
        ImuSample(round(1e9 * at), tuple(f), tuple(w))
        for at, f, w in zip(time_s, force.tolist(), fault(rate).tolist(), strict=True)
    ]


def seconds_that_contradict(samples: list[ImuSample]) -> int:
    agreement = GyroAgreement()
    count = 0
    for first in range(0, len(samples), int(RATE_HZ)):
        agreement.take(samples[first : first + int(RATE_HZ)])
        count += agreement.forces_contradict
    return count


FAULTS: dict[str, Fault] = {
    "z, x, y": lambda rate: rate[:, [2, 0, 1]],
    "x and z exchanged": lambda rate: rate[:, [2, 1, 0]],
    "in degrees": np.degrees,
}


@pytest.mark.parametrize("fault", FAULTS)
def test_rates_that_are_not_those_of_the_forces_contradict_them(fault: str) -> None:
    assert seconds_that_contradict(walk(FAULTS[fault])) > 30


def test_one_sensor_does_not_contradict_itself() -> None:
    assert seconds_that_contradict(walk()) == 0
    assert seconds_that_contradict(walk(turns_rad_s=4.0)) == 0


def test_what_is_lost_or_no_reading_contradicts_nothing() -> None:
    samples = walk(turns_rad_s=4.0)
    lost = [one for index, one in enumerate(samples) if index % 100 >= 20]
    assert seconds_that_contradict(lost) == 0
    nothing = (math.nan, math.nan, math.nan)
    blind = [ImuSample(one.time_ns, one.force_m_s2, nothing) for one in samples]
    assert seconds_that_contradict(blind) == 0


def handled(fault: Fault = np.array, *, iron_ut: float = 0.0) -> list[ImuSample]:
    """Return a phone that is put on, turned by 90° in two seconds, and a wearer who turns about."""
    time_s = np.arange(0.0, 20.0, 1.0 / RATE_HZ)
    tips = (time_s >= 2.0) & (time_s < 4.0)
    turns = (time_s >= 10.0) & (time_s < 13.0)
    rate = np.outer(tips * math.pi / 4.0, [1.0, 0.0, 0.0])
    rate += np.outer(turns * math.pi / 3.0, [0.0, 1.0, 0.0])
    tipped, turned = (
        Rotation.from_rotvec(np.cumsum(rate, axis=0) / RATE_HZ * axis)
        for axis in ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0])
    )
    sensor_from_level = (tipped * turned).inv()
    # After it was tipped up, what had been up lies along y, about which the wearer turns.
    force = sensor_from_level.apply([0.0, 0.0, 9.81])
    field = sensor_from_level.apply([0.0, 20.0, -45.0]) + iron_ut
    return [
        ImuSample(round(1e9 * at), tuple(f), tuple(w), tuple(m))
        for at, f, w, m in zip(
            time_s, force.tolist(), fault(rate).tolist(), field.tolist(), strict=True
        )
    ]


def what_contradicts(samples: list[ImuSample]) -> tuple[bool, bool]:
    """Return whether forces do, and the compass, in the end."""
    agreement = GyroAgreement()
    for first in range(0, len(samples), int(RATE_HZ)):
        agreement.take(samples[first : first + int(RATE_HZ)])
    return agreement.forces_contradict, agreement.compass_contradicts


def test_a_mirror_image_is_found_by_how_it_is_put_on_and_by_the_compass_and_not_forgotten() -> None:
    assert what_contradicts(handled(np.negative)) == (True, True)
    assert what_contradicts(handled()) == (False, False)


def test_a_compass_alone_may_be_the_one_that_is_mirrored() -> None:
    mirrored = [
        replace(one, field_ut=(-one.field_ut[0], *one.field_ut[1:]))
        for one in handled()
        if one.field_ut is not None
    ]
    assert what_contradicts(mirrored) == (False, True)


def test_iron_beside_the_compass_is_no_mirror() -> None:
    assert what_contradicts(handled(iron_ut=30.0)) == (False, False)


def test_a_compass_that_contradicts_is_a_finding() -> None:
    check = SelfCheck(Faults(), worn="chest")
    told = [check.take_sample(one) for one in handled(np.negative)]
    words = {words for one in told if one is not None for words in one.findings}
    assert any("turns contradict its compass" in one for one in words)


@pytest.mark.parametrize(("worn", "found"), [("chest", True), ("waist", True), ("boot", False)])
def test_it_is_a_finding_of_whoever_does_not_wear_it_on_a_boot(worn: Mount, found: bool) -> None:
    check = SelfCheck(Faults(), worn=worn)
    told = [check.take_sample(one) for one in walk(FAULTS["z, x, y"])]
    words = {words for one in told if one is not None for words in one.findings}
    assert any("turns contradict its forces" in one for one in words) == found
