"""Rides in a lift: begun by a push and a change of pressure together, by neither alone."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple, TypeAlias

import numpy as np
import pytest

from edge_agent.evaluation.truth import Array
from edge_agent.inertial.barometer import Reading
from edge_agent.inertial.lift import LiftWatch
from shared.messages import ImuSample
from shared.units import NS_PER_S

Watched: TypeAlias = Iterator[tuple[float, LiftWatch]]

RATE_HZ = 100
FINE_S = np.arange(0.0, 60.0, 1e-3)
NOISE_M, NOISE_M_S2 = 0.12, 0.05


def watched(
    force_m_s2: Callable[[float], float],
    height_m: Callable[[float], float],
    rate_rad_s: Callable[[float], float] = lambda _: 0.0,
    until_s: float = 30.0,
    readings_hz: int = 25,
) -> Watched:
    """The watch after each reading of a boot that feels and rises so, with noise."""
    watch, rng = LiftWatch(), np.random.default_rng(4)
    for index in range(round(until_s * RATE_HZ)):
        time_s, time_ns = index / RATE_HZ, index * NS_PER_S // RATE_HZ
        noise = rng.normal(0.0, NOISE_M_S2, 3)
        force = (noise[0], noise[1], -force_m_s2(time_s) + noise[2])
        watch.feel(ImuSample(time_ns, force, (rate_rad_s(time_s), 0.0, 0.0)))
        if index % (RATE_HZ // readings_hz) == 0:
            watch.take(Reading(time_ns, height_m(time_s) + rng.normal(0.0, NOISE_M)))
            yield time_s, watch


class Ride(NamedTuple):
    """A lift that sets off at 5 s with 1 m/s² and stands again ``lasts_s`` later."""

    top_m_s: float
    lasts_s: float

    def speed_m_s(self, time_s: Array) -> Array:
        """Speed (n,) upwards at ``time_s`` (n,)."""
        since_s = time_s - 5.0
        ramp = np.minimum(since_s, self.lasts_s - since_s)
        return np.asarray(np.sign(self.top_m_s) * np.clip(ramp, 0.0, abs(self.top_m_s)))

    def watched(
        self, *, pushes: bool = True, until_s: float = 30.0, readings_hz: int = 25
    ) -> Watched:
        """What the watch says of it; a fan does to the air as a lift does, and pushes nobody."""
        speeds_m_s = self.speed_m_s(FINE_S)
        heights_m = np.cumsum(speeds_m_s) * FINE_S[1]
        pushed_m_s2 = np.gradient(speeds_m_s, FINE_S) * pushes
        return watched(
            lambda time_s: 9.83 + float(np.interp(time_s, FINE_S, pushed_m_s2)),
            lambda time_s: float(np.interp(time_s, FINE_S, heights_m)),
            until_s=until_s,
            readings_hz=readings_hz,
        )


@pytest.mark.parametrize("readings_hz", [10, 25, 50])
@pytest.mark.parametrize(
    ("top_m_s", "lasts_s"), [(0.5, 10.0), (1.6, 8.0), (-1.6, 15.0), (2.5, 9.0)]
)
def test_a_ride_is_known_soon_and_until_it_ends(
    top_m_s: float, lasts_s: float, readings_hz: int
) -> None:
    watches = Ride(top_m_s, lasts_s).watched(readings_hz=readings_hz)
    told = [(time_s, watch.riding) for time_s, watch in watches]
    times_s = [time_s for time_s, on in told if on]
    assert 5.0 < times_s[0] < 7.0
    assert 4.5 + lasts_s < times_s[-1] < 5.0 + lasts_s + 3.0
    assert all(on for time_s, on in told if times_s[0] <= time_s <= times_s[-1])


@pytest.mark.parametrize("top_m_s", [0.5, 1.6, -2.5])
def test_a_fan_pushes_nobody(top_m_s: float) -> None:
    assert not any(watch.riding for _, watch in Ride(top_m_s, 10.0).watched(pushes=False))


def test_a_push_alone_is_no_lift_and_doubted_no_longer_than_it_must() -> None:
    def force_m_s2(time_s: float) -> float:
        return 9.83 + (0.8 if 5.0 <= time_s < 6.0 else 0.0)

    doubted_s = []
    for time_s, watch in watched(force_m_s2, lambda _: 0.0):
        assert not watch.riding
        doubted_s += [time_s] if watch.doubtful else []
    assert 5.0 < doubted_s[0] < 6.0
    assert doubted_s[-1] < 11.0


def test_steps_up_a_flight_are_no_ride() -> None:
    """Each stance is still for 0.4 s and pushes; pressure falls all the time."""

    def force_m_s2(time_s: float) -> float:
        return 9.83 + (0.8 if time_s % 1.3 < 0.4 else 5.0)

    def rate_rad_s(time_s: float) -> float:
        return 0.1 if time_s % 1.3 < 0.4 else 3.0

    for _, watch in watched(force_m_s2, lambda time_s: 0.3 * time_s, rate_rad_s):
        assert not watch.riding
        assert not watch.doubtful


def test_a_leap_of_the_pressure_is_no_ride() -> None:
    def force_m_s2(time_s: float) -> float:
        return 9.83 + (0.8 if 5.0 <= time_s < 6.0 else 0.0)

    for _, watch in watched(force_m_s2, lambda time_s: 3.0 * (time_s > 5.5)):
        assert not watch.riding


def test_what_was_ridden_is_known_by_its_time() -> None:
    *_, (_, watch) = Ride(1.5, 8.0).watched()
    seconds = [watch.rode(begin * NS_PER_S, (begin + 1) * NS_PER_S) for begin in range(25)]
    assert seconds.index(True) in range(1, 6)
    assert 12 <= 24 - seconds[::-1].index(True) <= 16
    assert all(seconds[6:12])


def test_without_readings_a_ride_is_not_known_to_go_on() -> None:
    *_, (last_s, watch) = Ride(1.5, 20.0).watched(until_s=10.0)
    assert watch.riding
    watch.take(Reading(round((last_s + 3.0) * NS_PER_S), 50.0))
    assert not watch.riding
    assert not watch.rode(11 * NS_PER_S, 12 * NS_PER_S)
