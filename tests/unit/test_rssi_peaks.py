"""When somebody passed: what makes a peak, when it is told, and what does not make another."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np
import pytest

from shared.config import ConfigError, parse_toml
from shared.rssi_peaks import Peak, PeakDetector, PeakSettings
from shared.units import NS_PER_S

PERIOD_S = 0.2
START_S = 1000.0


def ns(time_s: float) -> int:
    return round((START_S + time_s) * NS_PER_S)


def seconds(time_ns: int) -> float:
    return time_ns / NS_PER_S - START_S


def told(
    level_dbm: Callable[[float], float | None],
    until_s: float,
    settings: PeakSettings | None = None,
) -> list[tuple[float, Peak]]:
    """Return the peaks of a signal, each with the time (s) at which it was told."""
    detector = PeakDetector(settings or PeakSettings())
    peaks: list[tuple[float, Peak]] = []
    for time_s in np.arange(0.0, until_s, PERIOD_S).tolist():
        rssi_dbm = level_dbm(time_s)
        if rssi_dbm is not None:
            detector.add(ns(time_s), "r1", rssi_dbm)
        peaks += [(time_s, peak) for peak in detector.tick(ns(time_s))]
    return peaks


def passing(at_s: float, nearest_m: float, speed_m_s: float = 1.2) -> Callable[[float], float]:
    """Return the signal of somebody who walks past in a straight line."""

    def level_dbm(time_s: float) -> float:
        range_m = np.hypot(nearest_m, speed_m_s * (time_s - at_s))
        return float(-40.0 - 22.0 * np.log10(range_m))

    return level_dbm


def test_a_pass_is_one_peak_at_its_nearest() -> None:
    ((told_s, peak),) = told(passing(20.0, 1.0), 40.0)
    assert seconds(peak.time_ns) == pytest.approx(20.0, abs=0.1)
    assert peak.peak_dbm == pytest.approx(-40.0, abs=1.5)
    assert told_s < 20.0 + 3.0
    # At 6 dB less they are 1.87 times as far: 1.6 m of way, 1.3 s, to each side.
    assert 2.0 < peak.width_s < 3.2
    assert peak.sample_count > 5


def test_the_nearer_the_louder() -> None:
    levels_dbm = [told(passing(20.0, nearest_m), 40.0)[0][1].peak_dbm for nearest_m in (0.5, 1, 3)]
    assert levels_dbm == sorted(levels_dbm, reverse=True)


def test_a_distant_pass_is_none() -> None:
    assert told(passing(20.0, 9.0), 40.0) == []


def test_who_stands_near_is_told_once_within_the_stand() -> None:
    ((told_s, peak),) = told(lambda time_s: passing(10.0, 0.8)(min(time_s, 10.0)), 120.0)
    assert 10.0 < seconds(peak.time_ns) < 14.0
    assert told_s < 10.0 + 4.0 + 1.5


def test_who_turns_back_is_told_again() -> None:
    def level_dbm(time_s: float) -> float:
        return max(passing(20.0, 1.0)(time_s), passing(40.0, 1.0)(time_s))

    times_s = [seconds(peak.time_ns) for _, peak in told(level_dbm, 60.0)]
    assert times_s == pytest.approx([20.0, 40.0], abs=0.1)


def test_who_comes_nearer_after_a_stand_is_told_again() -> None:
    def level_dbm(time_s: float) -> float:
        return -56.0 if time_s < 30.0 else -45.0

    levels_dbm = [peak.peak_dbm for _, peak in told(level_dbm, 60.0)]
    assert levels_dbm == [-56.0, -45.0]


def test_who_falls_silent_is_told_and_then_forgotten() -> None:
    def level_dbm(time_s: float) -> float | None:
        return -45.0 if time_s < 5.0 or time_s > 20.0 else None

    peaks = told(level_dbm, 40.0)
    assert [peak.peak_dbm for _, peak in peaks] == [-45.0, -45.0]
    assert seconds(peaks[1][1].time_ns) > 20.0


def test_a_lone_spike_is_none() -> None:
    assert told(lambda time_s: -30.0 if 20.0 < time_s < 20.3 else None, 40.0) == []


def test_the_future_waits() -> None:
    detector = PeakDetector(PeakSettings())
    for time_s in np.arange(0.0, 2.0, PERIOD_S).tolist():
        detector.add(ns(time_s + 60.0), "r1", -40.0)
    assert detector.tick(ns(1.0)) == []
    later = [peak for time_s in range(60, 70) for peak in detector.tick(ns(time_s))]
    assert len(later) == 1


def test_stations_are_told_by_name() -> None:
    detector = PeakDetector(PeakSettings())
    peaks: list[Peak] = []
    for time_s in np.arange(0.0, 8.0, PERIOD_S).tolist():
        for station_id in ("r2", "r1"):
            detector.add(ns(time_s), station_id, -45.0)
        peaks += detector.tick(ns(time_s))
    assert [peak.station_id for peak in peaks] == ["r1", "r2"]


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("silence_s = 1.0", "silence_s: put it at or above window_s"),
        ("middle_s = 1.0", "middle_s: put it at or above window_s"),
        ("fall_bd = 3.0", "did you mean 'fall_db'"),
        ("hold_s = 0.0", "hold_s"),
    ],
)
def test_settings_that_cannot_be_are_refused(text: str, complaint: str) -> None:
    with pytest.raises(ConfigError, match=complaint):
        parse_toml(text, PeakSettings, "dap.toml")


def shuffled(
    readings: Iterable[tuple[float, float]], order: np.random.Generator
) -> list[tuple[float, float]]:
    """Return readings in another order, some of them twice."""
    listed = list(readings)
    listed += [listed[index] for index in order.integers(0, len(listed), len(listed) // 3)]
    order.shuffle(listed)
    return listed


def test_order_within_a_tick_and_repeats_change_nothing() -> None:
    chance = np.random.default_rng(3)
    signal = passing(10.0, 0.7)
    times_s = np.arange(0.0, 25.0, PERIOD_S)
    readings = [(t, signal(t) + d) for t, d in zip(times_s, chance.normal(0, 2, 200), strict=False)]
    outcomes = []
    for seed in range(3):
        order = np.random.default_rng(seed)
        detector = PeakDetector(PeakSettings())
        peaks: list[Peak] = []
        for second in range(26):
            due = [one for one in readings if second - 1 < one[0] <= second]
            for time_s, rssi_dbm in shuffled(due, order) if due else ():
                detector.add(ns(time_s), "r1", rssi_dbm)
            peaks += detector.tick(ns(second))
        outcomes.append(peaks)
    assert outcomes[0]
    assert outcomes[0] == outcomes[1] == outcomes[2]
