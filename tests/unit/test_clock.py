"""What is dated goes by a clock that nobody sets while the program runs."""

from __future__ import annotations

import time

import pytest

from shared.clock import ManualClock, PacedClock, ScaledClock, SystemClock, base_ns, steady_ns
from shared.units import NS_PER_S


@pytest.mark.parametrize("step_s", [60, -60, 3 * 3600])
def test_setting_the_machines_clock_changes_nothing(
    step_s: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    clock, before_ns = SystemClock(), SystemClock().now_ns()
    really = time.time_ns
    monkeypatch.setattr(time, "time_ns", lambda: really() + step_s * NS_PER_S)
    for each in (clock, SystemClock(), ScaledClock(before_ns, 1.0)):
        assert 0 <= each.now_ns() - before_ns < 30 * NS_PER_S


def test_a_time_zone_changes_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    before_ns = SystemClock().now_ns()
    monkeypatch.setenv("TZ", "Pacific/Kiritimati")
    time.tzset()
    try:
        assert 0 <= SystemClock().now_ns() - before_ns < 30 * NS_PER_S
    finally:
        monkeypatch.undo()
        time.tzset()


def test_it_reads_what_the_machines_clock_read_at_first() -> None:
    assert SystemClock().now_ns() == pytest.approx(time.time_ns(), abs=5 * NS_PER_S)
    assert SystemClock(base_ns=0).now_ns() == pytest.approx(steady_ns(), abs=5 * NS_PER_S)


def test_a_nodes_clock_changes_its_pace_once_an_exercise_begins() -> None:
    own = ManualClock(100 * NS_PER_S)
    clock = PacedClock(own)
    assert (clock.now_ns(), clock.pace) == (100 * NS_PER_S, 1.0)
    clock.run_from(100 * NS_PER_S, 10.0)
    own.set_ns(102 * NS_PER_S)
    assert (clock.now_ns(), clock.pace) == (120 * NS_PER_S, 10.0)
    assert clock.real_seconds_until(130 * NS_PER_S) == pytest.approx(1.0)


def test_a_process_that_is_stopped_while_it_looks_at_the_clock_looks_again() -> None:
    # Steady count and clock are read in turn; the machine stops the process at the first look.
    steady = iter([0, 9_000_000, 9_000_100, 9_000_300, *range(9_001_000, 9_002_000, 100)])
    clock = iter([1_000_000_000, 1_009_000_200, *range(1_009_001_050, 1_009_003_000, 200)])
    found_ns = base_ns(lambda: next(clock), lambda: next(steady))
    assert abs(found_ns - 1_000_000_000) <= 100
