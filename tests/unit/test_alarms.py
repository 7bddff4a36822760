"""Alarms: raised when they must be, once, and never for somebody who walks."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import chain
from pathlib import Path

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from edge_agent.alarms import AlarmEvent, AlarmWatch
from edge_agent.sources.npz_set import read_npz_set
from shared.messages import ImuSample
from shared.units import NS_PER_S
from tests.synthetic_boot import SyntheticWalk

FLAT = (0.0, 0.0, -9.81)
ON_ITS_SIDE = (0.0, -9.8, -0.5)
STILL = (0.0, 0.0, 0.0)
RATE_HZ = 100


def standing(
    from_s: float,
    to_s: float,
    force_m_s2: tuple[float, float, float] = FLAT,
    rate_rad_s: tuple[float, float, float] = STILL,
) -> Iterator[ImuSample]:
    for index in range(round(from_s * RATE_HZ), round(to_s * RATE_HZ)):
        yield ImuSample(index * NS_PER_S // RATE_HZ, force_m_s2, rate_rad_s)


def moving(from_s: float, to_s: float) -> Iterator[ImuSample]:
    return standing(from_s, to_s, FLAT, (0.0, 3.0, 0.0))


def told(*parts: Iterator[ImuSample], flat: bool = False) -> list[AlarmEvent]:
    watch = AlarmWatch()
    if flat:
        watch.flat = FLAT
    return [event for sample in chain(*parts) for event in watch.take_sample(sample)]


def when(events: list[AlarmEvent]) -> list[tuple[str, str, float]]:
    return [(one.kind, one.phase, one.time_ns / NS_PER_S) for one in events]


def test_stillness_alarms_in_two_stages_on_sample_time() -> None:
    events = told(standing(0.0, 60.0))
    assert when(events) == [("motionless", "pre_alarm", 20.0), ("motionless", "alarm", 30.0)]
    assert events[1].reason == "no motion of the boot for 30 s"


def test_motion_cancels_once() -> None:
    events = told(standing(0.0, 40.0), moving(40.0, 50.0), standing(50.0, 71.0))
    assert [event.phase for event in events] == ["pre_alarm", "alarm", "cancelled", "pre_alarm"]
    assert events[2].time_ns / NS_PER_S == pytest.approx(40.1, abs=0.02)
    assert events[3].time_ns / NS_PER_S == pytest.approx(70.0, abs=0.1)


def test_motion_after_the_pre_alarm_averts_the_alarm() -> None:
    events = told(standing(0.0, 25.0), moving(25.0, 26.0), standing(26.0, 45.0))
    assert [event.phase for event in events] == ["pre_alarm", "cancelled"]


@given(st.integers(0, 2**32 - 1), st.floats(0.0, 0.25), st.floats(0.15, 0.5))
def test_breathing_and_spikes_are_no_motion(seed: int, amplitude: float, breath_hz: float) -> None:
    chance = np.random.default_rng(seed)
    watch, phases = AlarmWatch(), []
    for sample in standing(0.0, 31.0):
        time_s = sample.time_ns / NS_PER_S
        breath = amplitude * math.sin(2.0 * math.pi * breath_hz * time_s)
        noise = chance.normal(0.0, 0.05, 6)
        spike = 8.0 if chance.random() < 0.01 else 0.0
        force = (breath + noise[0], noise[1], -9.81 + noise[2])
        rate = (0.2 * breath + 0.2 * noise[3], 0.2 * noise[4], 0.2 * noise[5] + spike)
        phases += [e.phase for e in watch.take_sample(ImuSample(sample.time_ns, force, rate))]
    assert phases == ["pre_alarm", "alarm"]


@given(
    st.lists(st.tuples(st.booleans(), st.floats(0.5, 45.0)), min_size=1, max_size=8),
)
def test_the_order_of_stages_holds_whatever_happens(spells: list[tuple[bool, float]]) -> None:
    watch, at_s = AlarmWatch(), 0.0
    before = "cancelled"
    for moves, lasts_s in spells:
        for sample in (moving if moves else standing)(at_s, at_s + lasts_s):
            events = watch.take_sample(sample)
            assert watch.take_sample(sample) == []
            for event in events:
                assert (before, event.phase) in {
                    ("cancelled", "pre_alarm"),
                    ("pre_alarm", "alarm"),
                    ("pre_alarm", "cancelled"),
                    ("alarm", "cancelled"),
                }
                before = event.phase
        at_s += lasts_s


def test_a_stalled_stream_is_not_stillness() -> None:
    events = told(standing(0.0, 5.0), standing(60.0, 74.9))
    assert events == []
    (late,) = told(standing(0.0, 5.0), standing(60.0, 76.0))
    assert late.time_ns / NS_PER_S == pytest.approx(75.0, abs=0.05)


def test_what_is_no_number_or_goes_back_is_passed_over() -> None:
    nothing = standing(3.0, 4.0, (math.nan, 0.0, 0.0))
    infinite = standing(4.0, 4.3, FLAT, (math.inf, 0.0, 0.0))
    assert told(standing(0.0, 3.0), nothing, infinite, standing(0.0, 2.0)) == []


def test_a_clock_set_back_does_not_silence_the_watch() -> None:
    late = (msgspec.structs.replace(one, time_ns=one.time_ns + 10**12) for one in moving(0.0, 15.0))
    events = told(late, standing(0.0, 32.0))
    assert [event.phase for event in events] == ["pre_alarm", "alarm"]
    assert events[0].time_ns / NS_PER_S == pytest.approx(21.0, abs=0.1)


def fall(force_after: tuple[float, float, float], knock_m_s2: float = 60.0) -> list[AlarmEvent]:
    knock = standing(10.0, 10.05, (0.0, -knock_m_s2, -9.81), (2.0, 0.0, 0.0))
    tumble = standing(10.05, 10.5, force_after, (3.0, 0.0, 0.0))
    rest = standing(10.5, 18.0, force_after)
    return told(moving(0.0, 10.0), knock, tumble, rest, moving(18.0, 24.0), flat=True)


def test_an_impact_then_lying_still_is_a_fall_until_they_are_up() -> None:
    raised, over = fall(ON_ITS_SIDE)
    assert (raised.kind, raised.phase) == ("fall", "alarm")
    assert raised.time_ns / NS_PER_S == pytest.approx(15.5, abs=0.2)
    assert raised.confidence > 0.8
    assert "impact of 61 m/s², then still" in raised.reason
    assert (over.kind, over.phase) == ("fall", "cancelled")
    assert over.time_ns / NS_PER_S == pytest.approx(21.0, abs=0.3)


def test_standing_still_after_a_hard_step_is_no_fall() -> None:
    assert fall(FLAT) == []


def test_lying_down_gently_is_no_fall() -> None:
    assert fall(ON_ITS_SIDE, knock_m_s2=15.0) == []


def test_a_crawlers_knocks_are_no_fall() -> None:
    crawl = standing(10.0, 14.0, ON_ITS_SIDE, (2.0, 0.0, 0.0))
    knock = standing(14.0, 14.05, (0.0, -60.0, 0.0), (2.0, 0.0, 0.0))
    rest = standing(14.05, 22.0, ON_ITS_SIDE)
    assert told(moving(0.0, 10.0), crawl, knock, rest, flat=True) == []


def test_walking_raises_none() -> None:
    assert told(SyntheticWalk(strides=60).samples(200.0), flat=True) == []


def test_no_real_recording_raises_one(data_dir: Path) -> None:
    files = [*data_dir.glob("foot_strides/*.npz"), *data_dir.glob("foot_vicon/*.npz")]
    files += data_dir.glob("foot_loops/*.npz")
    assert files
    for path in files:
        recording, _ = read_npz_set(path)
        watch = AlarmWatch()
        for index, sample in enumerate(recording):
            if index == 0:
                watch.flat = sample.force_m_s2
            assert watch.take_sample(sample) == [], path.name


@pytest.mark.parametrize("push_m_s2", [1.0, -1.5])
def test_a_lift_stirs_nobody_who_lies_still_in_it(push_m_s2: float) -> None:
    """Off at 12 s, there at 24 s, off again with the alarm on: the clock of PASS runs on."""
    forces = [
        (0.0, 12.0, 0.0), (12.0, 13.5, push_m_s2), (13.5, 24.0, 0.0), (24.0, 25.5, -push_m_s2),
        (25.5, 40.0, 0.0), (40.0, 41.5, push_m_s2), (41.5, 50.0, 0.0),
    ]  # fmt: skip
    parts = [standing(a, b, (0.0, 0.0, -9.81 - push)) for a, b, push in forces]
    assert when(told(*parts)) == [
        ("motionless", "pre_alarm", 20.0),
        ("motionless", "alarm", 30.0),
    ]


def test_a_push_that_no_lift_gives_is_motion() -> None:
    for force_m_s2 in ((1.0, 0.0, -9.81), (0.0, 0.0, -13.0)):
        events = told(standing(0.0, 25.0), standing(25.0, 26.0, force_m_s2), standing(26.0, 40.0))
        assert [event.phase for event in events] == ["pre_alarm", "cancelled"]
