"""What each degradation does to the samples, and that it does nothing else."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import TypeAlias

import numpy as np
import pytest

from edge_agent.evaluation.degradation import (
    DEGRADATIONS,
    NOISE_M_S2,
    NOISE_RAD_S,
    averaged,
    biased,
    clipped,
    cut,
    decimated,
    degradations,
    delayed,
    frozen,
    in_order,
    interpolated,
    interrupted,
    jittered,
    magnetised,
    noisy,
    repeated,
    scaled,
    stuck,
    thinned,
    turned,
    with_holes,
)
from edge_agent.evaluation.truth import Array, Height, Speed, Truth
from edge_agent.sources.recording import Recording
from shared.units import NS_PER_S

ALL = {**DEGRADATIONS, **degradations("waist")}

Lower: TypeAlias = Callable[[Recording, float], Recording]


def recording(rate_hz: float = 200.0, duration_s: float = 30.0) -> Recording:
    """Slow sines about 5 on force's axes and 0 on rate's, at even times from 3 s on."""
    count = round(duration_s * rate_hz)
    time_ns = 3 * NS_PER_S + np.rint(np.arange(count) / rate_hz * NS_PER_S).astype(np.int64)
    wave = np.sin(2.0 * np.arange(count)[:, None] / rate_hz + np.array([0.0, 1.0, 2.0]))
    pressure_pa = np.where(np.arange(count) % 8 == 0, 1e5 + wave[:, 0], np.nan)
    return Recording(time_ns, 5.0 + wave, 2.0 * wave, 40.0 + wave, pressure_pa)


def chance() -> np.random.Generator:
    return np.random.default_rng(11)


def integral(read: Recording) -> Array:
    """Trapezoidal integral of force over the recording."""
    return np.asarray(np.trapezoid(read.force_m_s2, read.time_ns / NS_PER_S, axis=0))


def test_averaging_by_two_is_the_mean_of_pairs() -> None:
    read = recording()
    half = averaged(read, 100.0)
    np.testing.assert_allclose(half.force_m_s2, read.force_m_s2.reshape(-1, 2, 3).mean(axis=1))
    np.testing.assert_allclose(half.rate_rad_s, read.rate_rad_s.reshape(-1, 2, 3).mean(axis=1))
    np.testing.assert_allclose(half.time_ns, read.time_ns.reshape(-1, 2).mean(axis=1), atol=1.0)
    assert half.field_ut is not None
    assert len(half.field_ut) == len(half)


def test_averaging_keeps_every_reading_of_a_slow_barometer() -> None:
    pressure_pa = np.full(len(recording()), np.nan)
    pressure_pa[[1, 6, 7]] = (100.0, 102.0, 104.0)
    half = averaged(replace(recording(), pressure_pa=pressure_pa), 100.0)
    assert half.pressure_pa is not None
    np.testing.assert_array_equal(half.pressure_pa[:5], [100.0, np.nan, np.nan, 103.0, np.nan])
    assert np.isnan(half.pressure_pa[5:]).all()


@pytest.mark.parametrize("from_hz", [204.8, 250.0, 397.7])
@pytest.mark.parametrize("rate_hz", [50.0, 100.0])
def test_averaging_keeps_integrals_at_any_pair_of_rates(from_hz: float, rate_hz: float) -> None:
    read = recording(from_hz)
    slow = averaged(read, rate_hz)
    np.testing.assert_allclose(np.diff(slow.time_ns) / NS_PER_S, 1.0 / rate_hz, atol=2e-9)
    cut = read.time_ns <= slow.time_ns[-1]
    whole = replace(read, time_ns=read.time_ns[cut], force_m_s2=read.force_m_s2[cut])
    np.testing.assert_allclose(integral(slow), integral(whole), atol=0.1)


def test_averaging_takes_away_what_is_too_fast_and_decimating_does_not() -> None:
    read = recording()
    buzz = np.where(np.arange(len(read)) % 2, 1.0, -1.0)[:, None]
    shaken = replace(read, force_m_s2=read.force_m_s2 + buzz)
    np.testing.assert_allclose(
        averaged(shaken, 100.0).force_m_s2, averaged(read, 100.0).force_m_s2, atol=1e-9
    )
    off = decimated(shaken, 100.0).force_m_s2 - decimated(read, 100.0).force_m_s2
    np.testing.assert_allclose(off, -1.0)


@pytest.mark.parametrize("from_hz", [200.0, 250.0, 397.7])
def test_decimating_keeps_samples_as_they_are(from_hz: float) -> None:
    read = recording(from_hz)
    few = decimated(read, 100.0)
    rows = np.searchsorted(read.time_ns, few.time_ns)
    np.testing.assert_array_equal(read.time_ns[rows], few.time_ns)
    np.testing.assert_array_equal(read.rate_rad_s[rows], few.rate_rad_s)
    assert len(few) == pytest.approx(3000, abs=2)


@pytest.mark.parametrize("lower", [averaged, decimated])
def test_a_slow_recording_is_not_made_faster(lower: Lower) -> None:
    read = recording(60.0)
    assert lower(read, 100.0) is read


@pytest.mark.parametrize("lower", [averaged, decimated])
def test_times_that_go_back_are_refused(lower: Lower) -> None:
    read = recording()
    with pytest.raises(ValueError, match="do not rise"):
        lower(replace(read, time_ns=read.time_ns[::-1]), 100.0)


def test_ranges_end_on_both_sides() -> None:
    read = recording()
    worse = clipped(replace(read, force_m_s2=-read.force_m_s2), 5.5, 1.5)
    assert worse.force_m_s2.min() == -5.5
    assert (worse.rate_rad_s.min(), worse.rate_rad_s.max()) == (-1.5, 1.5)
    inside = np.abs(read.rate_rad_s) < 1.5
    np.testing.assert_array_equal(worse.rate_rad_s[inside], read.rate_rad_s[inside])


def test_bias_and_scale_are_what_they_say() -> None:
    read = recording()
    np.testing.assert_allclose(biased(read, 0.1).rate_rad_s - read.rate_rad_s, 0.1)
    np.testing.assert_allclose(scaled(read, 1.01).force_m_s2 / read.force_m_s2, 1.01)
    field_ut, magnetised_ut = read.field_ut, magnetised(read, 20.0).field_ut
    assert field_ut is not None
    assert magnetised_ut is not None
    np.testing.assert_allclose(magnetised_ut - field_ut, 20.0)
    without = replace(read, field_ut=None)
    assert magnetised(without, 20.0).field_ut is None


def test_noise_is_as_strong_as_it_says() -> None:
    read = recording()
    worse = noisy(read, chance())
    assert np.std(worse.force_m_s2 - read.force_m_s2) == pytest.approx(NOISE_M_S2, rel=0.03)
    assert np.std(worse.rate_rad_s - read.rate_rad_s) == pytest.approx(NOISE_RAD_S, rel=0.03)


def test_one_in_twenty_is_lost() -> None:
    read = recording()
    left = thinned(read, chance(), 0.05)
    assert len(left) == pytest.approx(0.95 * len(read), rel=0.01)
    assert set(left.time_ns.tolist()) < set(read.time_ns.tolist())


def test_one_in_twenty_comes_twice_in_its_place() -> None:
    read = recording()
    more = repeated(read, chance(), 0.05)
    assert len(more) == pytest.approx(1.05 * len(read), rel=0.01)
    assert np.all(np.diff(more.time_ns) >= 0)
    np.testing.assert_array_equal(np.unique(more.time_ns), read.time_ns)


def test_late_samples_are_late_by_no_more_than_that() -> None:
    read = recording()
    mixed = delayed(read, chance(), 0.05, 0.1)
    np.testing.assert_array_equal(np.sort(mixed.time_ns), read.time_ns)
    late_ns = np.maximum.accumulate(mixed.time_ns) - mixed.time_ns
    assert np.mean(late_ns > 0) == pytest.approx(0.05, rel=0.2)
    assert 0.08 * NS_PER_S < late_ns.max() <= 0.1 * NS_PER_S


def test_gaps_come_as_often_as_they_say() -> None:
    left = interrupted(recording(), 0.2, 10.0)
    since_s = np.diff(left.time_ns) / NS_PER_S
    assert since_s[since_s > 0.1] == pytest.approx([0.205, 0.205])
    assert len(left) == 6000 - 3 * 40


def test_a_wrong_clock_is_wrong_for_samples_and_truth_alike() -> None:
    read = recording()
    times_s = np.array([4.0, 5.0, 6.0])
    truth = Truth(
        times_s, np.zeros((3, 2)), Height(times_s, times_s), Speed(times_s, times_s), taped_m=83.5
    )
    worse, told = DEGRADATIONS["clock +0.5 %"].apply(read, truth, chance())
    np.testing.assert_allclose(worse.time_ns, 1.005 * read.time_ns, rtol=1e-9)
    assert isinstance(told, Truth)
    assert told.height is not None
    np.testing.assert_allclose(told.time_s, 1.005 * times_s)
    np.testing.assert_allclose(told.height.time_s, 1.005 * times_s)
    np.testing.assert_array_equal(told.height.down_m, times_s)
    assert told.speed is not None
    np.testing.assert_allclose(told.speed.time_s, 1.005 * times_s)
    np.testing.assert_allclose(told.speed.speed_m_s, times_s / 1.005)
    assert told.taped_m == 83.5


def test_interpolating_draws_lines_between_samples() -> None:
    read = recording(50.0)
    fast = interpolated(read, 200.0)
    np.testing.assert_allclose(np.diff(fast.time_ns), 5e6, atol=2.0)
    np.testing.assert_allclose(fast.force_m_s2[::4], read.force_m_s2[:-1])
    middle = 0.5 * (read.rate_rad_s[1:] + read.rate_rad_s[:-1])
    np.testing.assert_allclose(fast.rate_rad_s[2::4], middle, atol=1e-9)


def test_stamps_are_off_by_that_and_rise() -> None:
    read = recording(50.0)
    worse = jittered(read, chance(), 0.005)
    assert np.all(np.diff(worse.time_ns) >= 0)
    assert np.std(worse.time_ns - read.time_ns) == pytest.approx(5e6, rel=0.05)
    np.testing.assert_array_equal(worse.force_m_s2, read.force_m_s2)


def test_holes_last_as_long_as_they_say() -> None:
    left = with_holes(recording(), chance(), 0.1, 0.4)
    gaps_s = np.diff(left.time_ns) / NS_PER_S
    holes_s = gaps_s[gaps_s > 0.01] - 0.005
    np.testing.assert_allclose(holes_s, 0.4 * np.rint(holes_s / 0.4), atol=0.011)
    assert 1.0 - len(left) / 6000 == pytest.approx(0.1, abs=0.1)


def test_what_is_cut_or_frozen_is_in_the_middle() -> None:
    read = recording()
    left, held = cut(read, 12.0), frozen(read, 5.0)
    (at,) = np.flatnonzero(np.diff(left.time_ns) > NS_PER_S)
    assert (left.time_ns[at + 1] - left.time_ns[at]) / NS_PER_S == pytest.approx(12.0, abs=0.01)
    assert (left.time_ns[at] - read.time_ns[0]) / NS_PER_S == pytest.approx(9.0, abs=0.01)
    same = (np.diff(held.force_m_s2, axis=0) == 0.0).all(axis=1)
    assert np.count_nonzero(same) / 200.0 == pytest.approx(5.0, abs=0.02)


def test_the_axis_that_is_most_upright_sticks_alone() -> None:
    upright = replace(recording(), force_m_s2=recording().force_m_s2 + np.array([0.0, 0.0, 9.0]))
    for force in (True, False):
        worse = stuck(upright, force=force)
        of = worse.force_m_s2 if force else worse.rate_rad_s
        other = upright.rate_rad_s if force else upright.force_m_s2
        assert np.ptp(of[3000:], axis=0)[2] == 0.0
        assert np.ptp(of[3000:], axis=0)[:2].min() > 0.5
        np.testing.assert_array_equal(worse.rate_rad_s if force else worse.force_m_s2, other)


def test_turning_keeps_lengths_and_what_lies_between() -> None:
    read = recording()
    worse = turned(read, chance())
    lengths, those = (np.linalg.norm(each.force_m_s2, axis=1) for each in (read, worse))
    np.testing.assert_allclose(lengths, those)
    between, there = (np.sum(each.force_m_s2 * each.rate_rad_s, axis=1) for each in (read, worse))
    np.testing.assert_allclose(between, there, atol=1e-9)
    assert np.abs(read.force_m_s2 - worse.force_m_s2).max() > 1.0


def test_what_comes_late_or_twice_is_not_in_order() -> None:
    read = recording()
    worse = in_order(delayed(repeated(read, chance(), 0.05), chance(), 0.05, 0.1))
    assert np.all(np.diff(worse.time_ns) > 0)
    assert 5000 < len(worse) < 6000


@pytest.mark.parametrize("name", ALL)
def test_the_same_chance_gives_the_same_and_the_recording_is_left_alone(name: str) -> None:
    read, untouched = recording(), recording()
    worse, again = (ALL[name].apply(read, None, chance())[0] for _ in range(2))
    for array in ("time_ns", "force_m_s2", "rate_rad_s", "field_ut", "pressure_pa"):
        np.testing.assert_array_equal(getattr(read, array), getattr(untouched, array))
        if getattr(worse, array) is not None:
            np.testing.assert_array_equal(getattr(worse, array), getattr(again, array))
            assert len(getattr(worse, array)) == len(worse)


@pytest.mark.parametrize("name", ALL)
def test_each_degradation_degrades(name: str) -> None:
    read = recording()
    hard = replace(
        read, force_m_s2=read.force_m_s2 * 30.0, rate_rad_s=read.rate_rad_s * math.radians(600.0)
    )
    worse, _ = ALL[name].apply(hard, None, chance())
    assert hard.field_ut is not None
    assert not (
        np.array_equal(worse.time_ns, hard.time_ns)
        and np.array_equal(worse.force_m_s2, hard.force_m_s2)
        and np.array_equal(worse.rate_rad_s, hard.rate_rad_s)
        and worse.field_ut is not None
        and np.array_equal(worse.field_ut, hard.field_ut)
        and worse.pressure_pa is not None
    )
