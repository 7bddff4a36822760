"""The boot's tracker on a boot whose motion is a formula."""

from __future__ import annotations

import math
from collections.abc import Iterable
from itertools import pairwise

import msgspec
import numpy as np
import pytest
from numpy.typing import NDArray

from edge_agent.inertial.boot_state import LOST, OUTCOME, STRIDE, Stride, initial_state
from edge_agent.inertial.boot_strides import run
from edge_agent.inertial.boot_tracker import BootTracker, resume
from edge_agent.inertial.eskf_parameters import EskfParameters, kernel_parameters
from edge_agent.inertial.sample_clock import place, start_clock
from shared.messages import ImuSample
from shared.units import NS_PER_S
from tests.synthetic_boot import SyntheticWalk

STRIDE_M = 1.2
RATE_HZ = 200.0


def walk(strides: int = 6, rate_hz: float = RATE_HZ) -> list[ImuSample]:
    return list(SyntheticWalk(strides=strides, stride_m=STRIDE_M).samples(rate_hz))


def strides_of(samples: Iterable[ImuSample], tracker: BootTracker | None = None) -> list[Stride]:
    tracker = tracker or BootTracker()
    return [stride for sample in samples for stride in tracker.step(sample)]


def lengths_m(strides: list[Stride]) -> NDArray[np.float64]:
    return np.array([math.hypot(*s.displacement_m[:2]) for s in strides if s.kind == STRIDE])


@pytest.mark.parametrize("rate_hz", [50.0, 100.0, 200.0, 397.7, 1000.0])
def test_an_error_free_walk_is_measured_at_any_rate(rate_hz: float) -> None:
    tracker = BootTracker()
    lengths = lengths_m(strides_of(walk(rate_hz=rate_hz), tracker))
    assert len(lengths) == 6
    np.testing.assert_allclose(lengths, STRIDE_M, atol=0.02)
    assert tracker.rate_hz == pytest.approx(rate_hz, rel=2e-3)


def test_strides_join_up_and_paths_lead_through_them() -> None:
    for before, after in pairwise(strides_of(walk())):
        assert before.end_ns == after.start_ns
        assert after.heading_rad == pytest.approx(before.heading_rad + after.heading_change_rad)
        assert after.path[0] == (after.start_ns, 0.0, 0.0, 0.0)
        assert after.path[-1] == (after.end_ns, *after.displacement_m)


@pytest.mark.parametrize("cut", [1, 60, 119, 121, 500, 903, 935, 1400])
def test_a_saved_tracker_goes_on_to_the_bit(cut: int) -> None:
    samples = walk()
    del samples[900:930]
    tracker = BootTracker()
    strides_of(samples[:cut], tracker)
    twin = resume(tracker.save())
    for sample in samples[cut:]:
        assert tracker.step(sample) == twin.step(sample)
    assert tracker.save() == twin.save()


def test_resuming_another_version_says_what_to_do() -> None:
    tracker = BootTracker()
    saved = msgspec.msgpack.decode(tracker.save())
    for broken in (b"", b"\xc1", msgspec.msgpack.encode(saved | {"state": b"short"})):
        with pytest.raises(ValueError, match="start a new one"):
            resume(broken)


def test_a_batch_is_the_online_step() -> None:
    samples = walk(strides=3)
    force = np.array([s.force_m_s2 for s in samples])
    rate = np.array([s.rate_rad_s for s in samples])
    n = len(samples)
    kernel = kernel_parameters(EskfParameters(), RATE_HZ)
    outcomes, path = np.zeros(50, OUTCOME), np.zeros((n, 3))
    state = initial_state(EskfParameters(), force[:40], rate[:40])
    dt, times = np.full(n, 1 / RATE_HZ), np.arange(n) * 5_000_000
    bridged, no_path = np.zeros(n, np.bool_), np.zeros((0, 3))
    count = run(state, outcomes, kernel, times, force, rate, dt, bridged, path)
    again, ones = initial_state(EskfParameters(), force[:40], rate[:40]), []
    for i in range(n):
        one, here = np.zeros(1, OUTCOME), slice(i, i + 1)
        if run(
            again, one, kernel, times[here], force[here], rate[here], dt[here], bridged[here],
            no_path,
        ):  # fmt: skip
            ones.append(one)
    assert count > 3
    assert np.concatenate(ones).tobytes() == outcomes[:count].tobytes()
    assert again.tobytes() == state.tobytes()


def test_swapped_neighbours_are_put_right() -> None:
    samples = walk(strides=10)
    swapped = samples.copy()
    places = range(450, 2200, 37)
    for i in places:
        swapped[i], swapped[i + 1] = swapped[i + 1], swapped[i]
    tracker = BootTracker()
    found = lengths_m(strides_of(swapped, tracker))
    assert tracker.counts.late_mended == len(places)
    np.testing.assert_allclose(found, lengths_m(strides_of(samples)), atol=2e-3)


@pytest.mark.parametrize("gap_s", [0.2, 0.4, 0.55])
def test_gaps_cost_little(gap_s: float) -> None:
    samples, missing = walk(strides=24), round(gap_s * RATE_HZ)
    gapped = [s for i, s in enumerate(samples) if i < 1000 or (i - 1070) % 500 >= missing]
    tracker = BootTracker()
    found, whole = lengths_m(strides_of(gapped, tracker)), lengths_m(strides_of(samples))
    assert tracker.counts.gaps == 10
    assert tracker.counts.bridged == 10 * missing
    assert tracker.counts.restarts == 0
    assert sum(found) == pytest.approx(sum(whole), abs=0.02)


def turn_variance_rad2(strides: list[Stride]) -> float:
    return sum(s.covariance[3][3] for s in strides)


def test_a_gap_is_bridged_though_the_next_follows_at_once() -> None:
    samples = walk(strides=12)
    thinned = [s for i, s in enumerate(samples) if i < 500 or i % 15]
    found, whole = strides_of(thinned), strides_of(samples)
    np.testing.assert_allclose(lengths_m(found), lengths_m(whole), atol=5e-3)
    assert turn_variance_rad2(found) < 1.2 * turn_variance_rad2(whole)


@pytest.mark.parametrize("late", [0, 4, 9])
def test_what_is_left_of_a_gap_is_bridged(late: int) -> None:
    samples = walk(strides=12)
    gapped = samples.copy()
    for first in range(2400, 500, -100):
        gapped[first : first + 15] = [*samples[first + 10 : first + 15], samples[first + late]]
    tracker = BootTracker()
    found, whole = strides_of(gapped, tracker), strides_of(samples)
    assert tracker.counts.late_mended == tracker.counts.gaps == 19
    np.testing.assert_allclose(lengths_m(found), lengths_m(whole), atol=5e-3)
    assert turn_variance_rad2(found) < 1.2 * turn_variance_rad2(whole)


def test_after_a_long_gap_the_heading_goes_on() -> None:
    turning = SyntheticWalk(strides=12, turn_rad=0.4)
    samples = [s for s in turning.samples(RATE_HZ) if not 9.0 < s.time_ns / NS_PER_S < 10.0]
    strides = strides_of(samples)
    lost = [k for k, stride in enumerate(strides) if stride.kind == LOST]
    assert len(lost) == 1
    before, after = strides[lost[0] - 1], strides[lost[0] + 1]
    assert strides[lost[0]].heading_rad == before.heading_rad
    assert after.heading_rad == pytest.approx(before.heading_rad, abs=0.9)
    assert abs(after.heading_rad) > 2.0


def test_numbers_that_are_whole_are_numbers() -> None:
    tracker = BootTracker()
    for index in range(400):
        tracker.step(ImuSample(index * 5_000_000, (0, 0, -9), (0, 0, 0)))
    assert tracker.rate_hz == pytest.approx(200.0)


@pytest.mark.parametrize("rate_hz", [10.0, 30.0])
def test_a_sensor_too_slow_for_a_foot_is_said(rate_hz: float) -> None:
    tracker = BootTracker()
    assert strides_of(walk(rate_hz=rate_hz), tracker) == []
    assert tracker.rate_hz is None
    assert tracker.trouble is not None
    assert tracker.counts.refused_starts > 3


def test_lost_samples_are_counted_and_no_time_is_lost() -> None:
    kept = [i for i in range(4000) if i % 50 not in (7, 8, 9)]
    stamps = [10**18 + round(i * 2.5105e6) for i in kept]
    clock = start_clock(stamps[:200])
    elapsed_s, missing = 0.0, 0
    for stamp in stamps[1:]:
        arrival = place(clock, stamp)
        elapsed_s += arrival.dt_s + arrival.missing * clock.period_ns / NS_PER_S
        clock, missing = arrival.state, missing + arrival.missing
    assert missing == 4000 - len(kept)
    assert elapsed_s == pytest.approx(3999 * 2.5105e-3, abs=5e-4)
