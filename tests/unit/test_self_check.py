"""The self-check: each fault put into a sound stream is found, and a sound stream has none."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

import msgspec
import numpy as np
import pytest

from edge_agent.mounts.interface import Faults, Increment
from edge_agent.mounts.methods import make_mount
from edge_agent.self_check.checker import HealthReport, SelfCheck
from edge_agent.self_check.settings import SelfCheckSettings
from edge_agent.sources.npz_set import read_npz_set
from shared.messages import WITHOUT_GYRO, ImuSample, Mount
from shared.units import NS_PER_S
from tests.synthetic_boot import SyntheticWalk

WALK = SyntheticWalk(strides=20, standing_s=4.0)


def walk(rate_hz: float = 100.0) -> Iterator[ImuSample]:
    """A walk read by a sensor with noise."""
    chance = np.random.default_rng(5)
    for sample in WALK.samples(rate_hz):
        noise = chance.normal(0.0, (0.02, 0.02, 0.02, 0.002, 0.002, 0.002)).tolist()
        (fx, fy, fz), (wx, wy, wz) = sample.force_m_s2, sample.rate_rad_s
        yield ImuSample(
            sample.time_ns,
            (fx + noise[0], fy + noise[1], fz + noise[2]),
            (wx + noise[3], wy + noise[4], wz + noise[5]),
        )


def reports(
    samples: Iterable[ImuSample], settings: SelfCheckSettings | None = None
) -> list[HealthReport]:
    mount = make_mount("boot", "linear")
    check = SelfCheck(mount.faults, settings)
    told = []
    for sample in samples:
        increment = mount.step(sample)
        if increment is not None:
            check.take_increment(increment)
        report = check.take_sample(sample)
        if report is not None:
            told.append(report)
    return told


def worst(told: list[HealthReport]) -> tuple[str, set[str]]:
    """Return the worst level told, and the first words of all findings."""
    level = max((report.level for report in told), key=("ok", "warning", "fault").index)
    return level, {" ".join(words.split()[:6]) for one in told for words in one.findings}


def test_a_sound_sensor_is_said_to_be_so_every_ten_seconds() -> None:
    told = reports(walk())
    assert worst(told) == ("ok", set())
    times_s = [report.time_ns / NS_PER_S for report in told]
    assert times_s == pytest.approx([1.0 + 10.0 * k for k in range(len(told))], abs=0.1)


def stuck(sample: ImuSample) -> ImuSample:
    return msgspec.structs.replace(sample, force_m_s2=(0.1, *sample.force_m_s2[1:]))


def unreadable(sample: ImuSample) -> ImuSample:
    bad = sample.time_ns // 10_000_000 % 10 == 0
    return msgspec.structs.replace(sample, rate_rad_s=(math.nan, 0.0, 0.0)) if bad else sample


def clipped(sample: ImuSample) -> ImuSample:
    x, y, z = (max(-4.0, min(4.0, value)) for value in sample.rate_rad_s)
    return msgspec.structs.replace(sample, rate_rad_s=(x, y, z))


def biased(sample: ImuSample) -> ImuSample:
    x, y, z = sample.rate_rad_s
    return msgspec.structs.replace(sample, rate_rad_s=(x + math.radians(3.0), y, z))


def scaled(sample: ImuSample) -> ImuSample:
    x, y, z = sample.force_m_s2
    return msgspec.structs.replace(sample, force_m_s2=(1.2 * x, 1.2 * y, 1.2 * z))


def in_g(sample: ImuSample) -> ImuSample:
    x, y, z = sample.force_m_s2
    return msgspec.structs.replace(sample, force_m_s2=(x / 9.81, y / 9.81, z / 9.81))


def in_degrees(sample: ImuSample) -> ImuSample:
    x, y, z = map(math.degrees, sample.rate_rad_s)
    return msgspec.structs.replace(sample, rate_rad_s=(x, y, z))


def without_rates(sample: ImuSample) -> ImuSample:
    return msgspec.structs.replace(sample, rate_rad_s=WITHOUT_GYRO)


@pytest.mark.parametrize(
    ("spoil", "level", "words"),
    [
        (stuck, "fault", "Boot sensor reads the same value"),
        (unreadable, "fault", "Boot sensor sends 10.0% unreadable values:"),
        (clipped, "fault", "Boot turns are beyond the sensor's"),
        (biased, "warning", "Boot sensor turns by 3.0 °/s"),
        (scaled, "fault", "Boot sensor reads gravity as 11.8,"),
        (in_g, "fault", "Boot sensor tells forces in g:"),
        (in_degrees, "fault", "Boot sensor tells turns in °/s:"),
        (without_rates, "fault", "Boot sensor tells no turns: steps"),
    ],
)
def test_a_spoilt_reading_is_found(spoil: object, level: str, words: str) -> None:
    assert callable(spoil)
    found_level, found = worst(reports(map(spoil, walk())))
    assert found_level == level
    assert words in found


def warmed(from_c: float, by_c_min: float) -> Iterator[ImuSample]:
    """A walk whose sensor tells its temperature at every tenth sample."""
    for index, sample in enumerate(walk()):
        now_c = from_c + by_c_min * sample.time_ns / NS_PER_S / 60.0
        yield msgspec.structs.replace(sample, temperature_c=None if index % 10 else now_c)


@pytest.mark.parametrize(
    ("from_c", "by_c_min", "level", "words"),
    [
        (20.0, 2.0, "ok", None),
        (75.0, 0.0, "warning", "Boot sensor is at 75 °C,"),
        (90.0, 0.0, "fault", "Boot sensor is at 90 °C,"),
        (-45.0, 0.0, "fault", "Boot sensor is at -45 °C,"),
        (20.0, 12.0, "warning", "Boot sensor warms by 12 °C"),
        (20.0, -15.0, "warning", "Boot sensor cools by 15 °C"),
    ],
)
def test_heat_and_cold_are_told(
    from_c: float, by_c_min: float, level: str, words: str | None
) -> None:
    found_level, found = worst(reports(warmed(from_c, by_c_min)))
    assert found_level == level
    assert found == (set() if words is None else {words})


def test_a_temperature_that_is_no_number_says_nothing() -> None:
    spoilt = (msgspec.structs.replace(sample, temperature_c=math.nan) for sample in walk())
    assert worst(reports(spoilt)) == ("ok", set())


def test_missing_samples_are_found() -> None:
    thinned = (one for index, one in enumerate(walk()) if index % 20 >= 2)
    assert "10% of the boot sensor's readings" in worst(reports(thinned))[1]


def test_samples_that_arrive_in_bunches_are_not_missing() -> None:
    bunched = (
        msgspec.structs.replace(one, time_ns=samples[-1].time_ns + index)
        for samples in batched(walk(), 4)
        for index, one in enumerate(samples)
    )
    assert worst(reports(bunched)) == ("ok", set())


def batched(samples: Iterable[ImuSample], size: int) -> Iterator[list[ImuSample]]:
    held: list[ImuSample] = []
    for sample in samples:
        held.append(sample)
        if len(held) == size:
            yield held
            held = []


def test_a_clock_set_back_is_found() -> None:
    samples = list(walk())
    early = [msgspec.structs.replace(one, time_ns=one.time_ns - 10**12) for one in samples]
    assert worst(reports([*samples, *early[:500]])) == (
        "warning",
        {"Boot sensor's readings come out of", "Boot sensor's clock was set back:"},
    )


def test_a_frozen_sensor_is_found() -> None:
    frozen = (ImuSample(k * 10_000_000, (0.0, 0.0, -9.81), (0.0, 0.0, 0.0)) for k in range(1000))
    assert worst(reports(frozen)) == ("fault", {"Boot sensor repeats one reading: restart"})


@pytest.mark.parametrize(
    ("worn", "rate_hz", "level"),
    [
        ("vehicle", 25.0, "fault"),
        ("vehicle", 52.0, "warning"),
        ("vehicle", 100.0, "ok"),
        ("chest", 25.0, "ok"),
        ("chest", 13.0, "warning"),
        ("waist", 8.0, "fault"),
    ],
)
def test_a_sensor_that_is_too_slow_for_the_road_or_for_steps_is_found(
    worn: Mount, rate_hz: float, level: str
) -> None:
    check = SelfCheck(Faults(), worn=worn)
    told = [one for sample in walk(rate_hz) if (one := check.take_sample(sample)) is not None]
    words = {words.split(" times")[0] for one in told for words in one.findings}
    assert told[-1].level == level
    assert words == (
        {f"{worn.capitalize()} sensor reads only {rate_hz:.0f}"} if level != "ok" else set()
    )


def test_a_rate_unlike_the_nominal_one_is_found() -> None:
    told = reports(walk(98.0), SelfCheckSettings(nominal_rate_hz=100.0))
    assert told[-1].findings == ("Boot sensor reads 98.0 times a second, not 100: set it up",)
    assert reports(walk(), SelfCheckSettings(nominal_rate_hz=100.0))[-1].level == "ok"


@pytest.mark.parametrize(("fault", "level"), [(None, "ok"), (stuck, "fault")])
def test_how_the_sensor_is_worn_is_told_after_what_is_wrong(
    fault: Callable[[ImuSample], ImuSample] | None, level: str
) -> None:
    check = SelfCheck(Faults())
    check.worn = "Boot sensor found: its +x axis points forward, its +z axis down"
    samples = walk() if fault is None else map(fault, walk())
    told = [report for sample in samples if (report := check.take_sample(sample))]
    assert worst(told)[0] == level
    assert {report.findings[-1] for report in told} == {check.worn}


def test_swings_without_an_end_are_found() -> None:
    check = SelfCheck(Faults())
    for index in range(6):
        start_ns = 10 * index * NS_PER_S
        long = Increment(
            start_ns, start_ns + 5 * NS_PER_S, (0.0, 0.0, 0.0), 0.0, 0.0, (0.0,) * 10, ()
        )
        check.take_increment(long)
    told = [report for sample in walk() if (report := check.take_sample(sample))]
    assert worst(told) == ("fault", {"Boot is rarely found at rest"})


def test_a_stream_that_stops_is_told_once_with_the_time_it_was_certain() -> None:
    check = SelfCheck(Faults())
    for sample in walk():
        check.take_sample(sample)
    end_ns = round(WALK.duration_s * NS_PER_S)
    assert check.pass_time(end_ns + NS_PER_S // 2) is None
    report = check.pass_time(end_ns + 60 * NS_PER_S)
    assert report is not None
    assert report.level == "fault"
    assert report.time_ns == pytest.approx(end_ns + NS_PER_S, abs=1e7)
    assert report.findings == ("Boot sensor has stopped sending: check its battery and its cable",)
    assert check.pass_time(end_ns + 90 * NS_PER_S) is None


def test_real_sensors_are_sound(data_dir: Path) -> None:
    for name in (
        "foot_strides/walk_31",
        "foot_strides/walk_40",
        "foot_vicon/2017-11-22-11-22-03",
        "foot_loops/xio_short_walk",
    ):
        recording, _ = read_npz_set(data_dir / f"{name}.npz")
        assert worst(reports(recording)) == ("ok", set()), name
