"""Each of the four conditions alone makes or breaks a stance, at any rate."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

import pytest

from edge_agent.inertial.stance import RunningVariance, StanceDetector, StanceSettings
from shared.messages import ImuSample, Vector3
from shared.units import NS_PER_S

STILL: Vector3 = (0.0, 0.0, -9.81)
NO_TURN: Vector3 = (0.0, 0.0, 0.0)


@dataclass
class Signal:
    """What a sensor reads over time; still where nothing is said."""

    duration_s: float = 2.0
    force_m_s2: Callable[[float], Vector3] = lambda _t: STILL
    rate_rad_s: Callable[[float], Vector3] = lambda _t: NO_TURN
    missing: Callable[[float], bool] = field(default=lambda _t: False)

    def samples(self, rate_hz: float) -> Iterable[ImuSample]:
        """Every sample but the missing ones."""
        for index in range(int(self.duration_s * rate_hz) + 1):
            time_s = index / rate_hz
            if not self.missing(time_s):
                time_ns = round(time_s * NS_PER_S)
                yield ImuSample(time_ns, self.force_m_s2(time_s), self.rate_rad_s(time_s))


def stances_s(signal: Signal, rate_hz: float = 100.0) -> list[tuple[float, float]]:
    """First and last sample of each detected stance, seconds."""
    detector = StanceDetector()
    found: list[tuple[float, float]] = []
    standing = False
    for sample in signal.samples(rate_hz):
        for decided, stance in detector.step(sample):
            time_s = decided.time_ns / NS_PER_S
            if stance:
                found.append((found.pop()[0] if standing else time_s, time_s))
            standing = stance
    return found


def between(time_s: float, start_s: float, end_s: float) -> bool:
    return start_s - 1e-9 <= time_s <= end_s + 1e-9


def test_a_boot_that_stands_is_a_stance_once_there_is_a_window_of_it() -> None:
    assert stances_s(Signal()) == [pytest.approx((0.08, 1.775), abs=0.02)]


def test_a_decision_comes_after_the_stated_delay() -> None:
    settings = StanceSettings()
    assert settings.delay_s == pytest.approx(0.225)
    detector = StanceDetector(settings)
    for sample in Signal().samples(200.0):
        for decided, _ in detector.step(sample):
            lag_s = (sample.time_ns - decided.time_ns) / NS_PER_S
            assert settings.delay_s <= lag_s + 1e-9 <= settings.delay_s + 0.01


@pytest.mark.parametrize(("level_rad_s", "stands"), [(0.59, True), (0.60, True), (0.61, False)])
def test_gyro_level_counts_x_and_y(level_rad_s: float, stands: bool) -> None:
    split = level_rad_s / math.sqrt(2.0)
    turning = Signal(rate_rad_s=lambda _t: (split - 1e-12, split - 1e-12, 0.0))
    assert bool(stances_s(turning)) is stands


def test_a_turn_about_the_vertical_alone_is_still_a_stance() -> None:
    assert len(stances_s(Signal(rate_rad_s=lambda _t: (0.0, 0.0, 3.0)))) == 1


def test_gyro_variance_reaches_as_far_as_its_window() -> None:
    # A burst at 1 s: by level only its own samples move, by variance all within half a window.
    def burst(t: float) -> Vector3:
        return (0.0, 5.0, 0.0) if between(t, 0.99, 1.01) else NO_TURN

    before, after = stances_s(Signal(rate_rad_s=burst))
    assert before[1] == pytest.approx(0.99 - 0.075, abs=0.02)
    assert after[0] == pytest.approx(1.01 + 0.075, abs=0.02)


def test_gyro_variance_under_its_limit_is_let_pass() -> None:
    # A square wave of 0 and 0.6 rad/s has a variance of 0.09.
    wave = Signal(rate_rad_s=lambda t: (0.6 * (round(t * 100) % 2), 0.0, 0.0))
    assert len(stances_s(wave)) == 1


SHAKES: dict[str, tuple[Callable[[float], Vector3], float]] = {
    # Each moves x and z so that one of the three variances is above its threshold alone.
    "energy": (lambda s: (0.0, 0.0, -9.81 + 0.8 * s), 0.64 * (2 * 9.81) ** 2),
    "product": (lambda s: (0.8 * s, 0.0, -9.81), 0.64 * 9.81**2),
    "sum": (lambda s: (1.2 * s, 0.0, 0.0), 1.44),
}


@pytest.mark.parametrize("what", SHAKES)
def test_each_eps_variance_is_held_against_its_own_threshold(what: str) -> None:
    force, variance = SHAKES[what]
    shaken = Signal(force_m_s2=lambda t: force(1.0 if round(t * 100) % 2 else -1.0))
    wide_open = StanceSettings(
        energy_variance_m4_s8=1e9, product_variance_m4_s8=1e9, sum_variance_m2_s4=1e9
    )
    name = {
        "energy": "energy_variance_m4_s8",
        "product": "product_variance_m4_s8",
        "sum": "sum_variance_m2_s4",
    }[what]

    def stands(threshold: float) -> bool:
        detector = StanceDetector(wide_open._replace(**{name: threshold}))
        return any(d.stance for s in shaken.samples(100.0) for d in detector.step(s))

    # Over 15 samples of ±1 the variance is 1 − 1/225 of the square.
    assert not stands(0.98 * variance)
    assert stands(1.02 * variance)


def test_sideways_force_is_not_looked_at() -> None:
    swayed = Signal(force_m_s2=lambda t: (0.0, 50.0 * math.sin(40.0 * t), -9.81))
    assert len(stances_s(swayed)) == 1


@pytest.mark.parametrize(
    ("sample_count", "found"), [(5, 0), (9, 0), (10, 0), (11, 1), (12, 1), (20, 1)]
)
def test_ten_samples_at_100_hz_are_too_short_and_eleven_are_not(
    sample_count: int, found: int
) -> None:
    first = 100 - sample_count // 2

    def rate(t: float) -> Vector3:
        return (0.0, 0.6 if first <= round(t * 100) < first + sample_count else 0.601, 0.0)

    assert len(stances_s(Signal(rate_rad_s=rate))) == found


def rolling(quietest_s: float, rate_per_s: float = 1.0) -> Callable[[float], Vector3]:
    """A foot that turns ever more slowly up to a moment, and ever faster after it."""
    return lambda t: (0.0, rate_per_s * abs(t - quietest_s), 0.0)


def test_a_short_stance_is_bounded_by_its_one_quietest_moment() -> None:
    # Below 0.6 rad/s from 0.95 to 1.05 s and a bit, at 10 rad/s².
    assert stances_s(Signal(rate_rad_s=rolling(1.0, 10.0))) == [pytest.approx((1.0, 1.0))]


def test_the_quietest_moment_is_sought_near_the_edges_only() -> None:
    # Below 0.6 rad/s from 0.4 to 1.6 s: the edges reach 0.15 s inwards of that.
    assert stances_s(Signal(rate_rad_s=rolling(1.0))) == [pytest.approx((0.55, 1.45), abs=0.011)]


def test_the_end_of_a_recording_ends_a_stance() -> None:
    detector = StanceDetector()
    samples = list(Signal(duration_s=1.0).samples(100.0))
    told = [d for s in samples for d in detector.step(s)]
    rest = detector.finish()
    assert [d.sample for d in told + rest] == samples[: len(told + rest)]
    assert all(d.stance for d in rest)
    assert len(samples) - len(told + rest) == 8


@pytest.mark.parametrize("rate_hz", [50.0, 100.0, 200.0, 397.7, 1000.0])
def test_the_same_stances_at_any_rate(rate_hz: float) -> None:
    def rate(t: float) -> Vector3:
        return (0.0, 6.0 * max(0.0, math.sin(2.0 * math.pi * t)), 0.0)

    def force(t: float) -> Vector3:
        return (8.0 * max(0.0, math.sin(2.0 * math.pi * t)), 0.0, -9.81)

    signal = Signal(duration_s=5.0, force_m_s2=force, rate_rad_s=rate)
    found, at_500 = stances_s(signal, rate_hz), stances_s(signal, 500.0)
    assert len(found) == len(at_500) == 5
    for one, other in zip(found, at_500, strict=True):
        assert one == pytest.approx(other, abs=2.0 / rate_hz + 0.003)


def test_over_a_gap_nobody_stands() -> None:
    found = stances_s(Signal(missing=lambda t: 0.9 < t < 1.1))
    assert len(found) == 2
    assert found[0][1] <= 0.9
    assert found[1][0] >= 1.1


def test_a_lost_sample_or_two_does_not_end_a_stance() -> None:
    assert len(stances_s(Signal(missing=lambda t: between(t, 1.0, 1.01)))) == 1


def test_every_sample_is_decided_once_and_in_order() -> None:
    detector = StanceDetector()
    samples = list(Signal(missing=lambda t: 0.4 < t < 0.8).samples(100.0))
    decided = [d.sample for s in samples for d in detector.step(s)]
    assert decided == samples[: len(decided)]
    assert len(decided) > len(samples) - 26


def test_a_spike_leaves_nothing_behind() -> None:
    variance = RunningVariance()
    variance.push(1e9)
    for _ in range(10):
        variance.push(0.125)
    variance.drop()
    assert variance.variance() == 0.0
