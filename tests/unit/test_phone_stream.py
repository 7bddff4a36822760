"""What a phone sends while it is carried, and what becomes of it."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from edge_agent.mounts.chest import ChestMount
from edge_agent.sources.phone_stream import (
    PhonePush,
    PhoneReading,
    PhoneStream,
    decoded,
    speeds_of,
    unreadable,
)
from shared.messages import ImuSample, Vector3
from tests.bouncing_phone import Phone

BEGIN_NS = 1_698_501_144_401_773_000


def reading(name: str, time_ns: int, vector: Vector3) -> PhoneReading:
    return PhoneReading(name, time_ns, dict(zip("xyz", vector, strict=True)))


def batches(
    samples: Sequence[ImuSample], size: int = 50, *, gyro: bool = True
) -> Iterable[PhonePush]:
    """Return messages as the app sends them: sensor by sensor, the gyroscope a little behind."""
    for first in range(0, len(samples), size):
        some = samples[first : first + size]
        rates = [reading("gyroscope", one.time_ns + 4_000_000, one.rate_rad_s) for one in some]
        forces = [reading("totalAcceleration", one.time_ns, one.force_m_s2) for one in some]
        yield PhonePush([*(rates if gyro else []), *forces])


def walk(steps: int = 20) -> list[ImuSample]:
    return list(Phone(steps=steps, turn_rad_s=0.1).samples(BEGIN_NS))


def streamed(pushes: Iterable[PhonePush]) -> list[ImuSample]:
    stream = PhoneStream()
    return [sample for push in pushes for sample in stream.take(push)]


def test_a_walk_comes_through_whole_and_in_order() -> None:
    samples = walk()
    found = streamed(batches(samples))
    assert [one.time_ns for one in found] == [one.time_ns for one in samples]
    assert [one.force_m_s2 for one in found] == [one.force_m_s2 for one in samples]
    mount = ChestMount()
    told = [one for sample in found if (one := mount.step(sample)) is not None] + mount.finish()
    assert sum(one.steps for one in told) == 20


def test_rates_are_interpolated_between_their_own_times() -> None:
    stream = PhoneStream()
    rates = [reading("gyroscope", BEGIN_NS + k * 10**8, (float(k), 0.0, 0.0)) for k in range(3)]
    fields = [reading("magnetometer", BEGIN_NS + 10**9, (20.0, 0.0, -40.0))]
    forces = [reading("TotalAcceleration", BEGIN_NS + 5 * 10**7, (0.0, 0.0, 9.8))]
    (sample,) = stream.take(PhonePush([*rates, *fields, *forces]))
    assert sample.rate_rad_s == pytest.approx((0.5, 0.0, 0.0))
    assert sample.field_ut == (20.0, 0.0, -40.0)


def test_a_location_tells_its_speed() -> None:
    told: list[dict[str, object]] = [
        {"speed": 12, "speedAccuracy": 0.4, "latitude": 1.0},
        {"speed": 12.5},
        {"speed": -1, "speedAccuracy": -1},
        {"speed": "fast"},
    ]
    push = PhonePush([PhoneReading("location", BEGIN_NS, values) for values in told])
    assert speeds_of(push) == [(BEGIN_NS, 12, 0.4), (BEGIN_NS, 12.5, 1.0)]
    assert PhoneStream().take(push) == []


def test_force_without_gravity_has_it_added() -> None:
    stream = PhoneStream()
    readings = [
        reading(name, BEGIN_NS + k * 10**7, vector)
        for k in range(400)
        for name, vector in (("accelerometer", (1.0, 0.0, 0.0)), ("gravity", (0.0, 0.0, 9.8)))
    ]
    found = stream.take(PhonePush(readings))
    assert found[0].force_m_s2 == (1.0, 0.0, 9.8)
    assert all(map(math.isnan, found[0].rate_rad_s))


def test_a_phone_without_a_gyroscope_is_waited_for_but_once() -> None:
    samples = walk(40)
    stream = PhoneStream()
    behind_ns = []
    for push in batches(samples, 25, gyro=False):
        found = stream.take(push)
        if found:
            behind_ns.append(push.payload[-1].time - found[-1].time_ns)
    assert behind_ns
    assert max(behind_ns) == 0
    assert len(streamed(batches(samples, 25, gyro=False))) == len(samples)


def test_a_gyroscope_that_falls_silent_holds_nothing_up_for_long() -> None:
    samples = walk(40)
    begun, silent = samples[:500], samples[500:]
    found = streamed([*batches(begun), *batches(silent, gyro=False)])
    assert len(found) == len(samples)
    # A quarter of a second after its last reading nobody knows how the phone turns.
    assert sum(not math.isnan(one.rate_rad_s[0]) for one in found) == pytest.approx(525, abs=1)


def test_a_clock_that_is_set_back_begins_anew() -> None:
    samples = walk()
    earlier = [msgspec.structs.replace(one, time_ns=one.time_ns - 10**12) for one in samples]
    found = streamed([*batches(samples), *batches(earlier)])
    assert found[-1].time_ns == earlier[-1].time_ns
    assert len(found) == 2 * len(samples)


def test_late_and_unknown_readings_are_passed_over() -> None:
    samples = walk()
    pushes = list(batches(samples))
    strange = PhonePush(
        [
            PhoneReading("location", BEGIN_NS, {"latitude": 1.0}),
            PhoneReading("gyroscope", BEGIN_NS, {"x": None, "y": "a", "z": 10**400}),
        ]
    )
    assert streamed([*pushes, pushes[-1], strange]) == streamed(pushes)


def test_a_message_that_comes_twice_or_too_late_is_not_the_next() -> None:
    stream = PhoneStream()
    told = (("a", 0), ("a", 1), ("a", 1), ("a", 3), ("a", 2), ("b", 0), ("b", 0), ("", None))
    taken = [stream.is_next(PhonePush([], session, number)) for session, number in told]
    assert taken == [True, True, False, True, False, True, False, True]
    assert stream.is_next(PhonePush([]))


def test_times_in_another_unit_are_told() -> None:
    (push,) = batches(walk()[:50])
    in_ms = [msgspec.structs.replace(one, time=one.time // 10**6) for one in push.payload]
    with pytest.raises(ValueError, match="not in nanoseconds"):
        decoded(msgspec.json.encode(PhonePush(in_ms)))
    assert decoded(msgspec.json.encode(push)) == push


def test_a_sensor_that_tells_no_numbers_is_found() -> None:
    told = [
        PhoneReading("gyroscope", BEGIN_NS, {"x": "0,1", "y": "0,1", "z": "0,1"}),
        PhoneReading("Gravity", BEGIN_NS, {}),
        reading("Gravity", BEGIN_NS, (0.0, 0.0, 9.8)),
        PhoneReading("location", BEGIN_NS, {}),
    ]
    assert unreadable(PhonePush(told)) == {"gyroscope"}


@given(st.binary(max_size=60) | st.text(max_size=60).map(str.encode))
def test_garbage_is_told_and_never_breaks_the_stream(body: bytes) -> None:
    try:
        push = decoded(body)
    except ValueError:
        return
    PhoneStream().take(push)


def test_a_message_is_read_as_the_app_writes_it() -> None:
    body = (
        b'{"messageId": 0, "sessionId": "s", "deviceId": "d", "payload": [{"name": "gyroscope",'
        b' "time": 1698501144401773000, "accuracy": 3, "values": {"z": 0.3, "y": 0.2, "x": 0.1}}]}'
    )
    (one,) = decoded(body).payload
    assert (one.name, one.time, one.values["x"]) == ("gyroscope", BEGIN_NS, 0.1)
