"""What a phone sends while it is carried, as samples: JSON, each sensor by itself (pure).

The messages are those of the app 'Sensor Logger' ("HTTP Push"), and of our own page: readings with
a sensor's name, a time in nanoseconds and values x, y and z, in the phone's axes and in SI, gravity
read upwards (in the app: "Standardise Units & Frames"). Of a location the speed is read.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from itertools import islice
from statistics import fmean
from typing import Annotated, NamedTuple

import msgspec
from msgspec import Meta

from edge_agent.gnss import SpeedReading, speed_reading
from shared.messages import WITHOUT_GYRO, ImuSample, Vector3
from shared.units import NS_PER_S

MOST_READINGS = 20_000
PATIENCE_NS = 3 * NS_PER_S
"""A sensor that is so far behind the accelerometer is not waited for."""

SILENT_NS = NS_PER_S // 4
"""So far from its readings a gyroscope is taken to have read nothing."""

MOST_SESSIONS = 100
"""So many that are over are remembered."""

FEWEST_TO_TIME = 10
SHORTEST_PERIOD_NS = 100_000
"""Readings that are nearer to each other are not told in nanoseconds."""

SURELY_UPSIDE_DOWN_M_S2 = 3.0

TOTAL, MOVED, GRAVITY = "totalacceleration", "accelerometer", "gravity"
RATE, FIELD = "gyroscope", "magnetometer"
LOCATION = "location"
Number = int | float
SENSORS = (TOTAL, MOVED, GRAVITY, RATE, FIELD)


class PhoneReading(msgspec.Struct, frozen=True):
    """One reading of one sensor; ``values`` of other sensors may be anything."""

    name: str
    time: Annotated[int, Meta(ge=0, le=2**62)]
    values: dict[str, object] = {}


class PhonePush(msgspec.Struct, frozen=True, rename="camel"):
    """What a phone sends at once: the ``message_id``-th of a session, if it counts."""

    payload: list[PhoneReading]
    session_id: str = ""
    message_id: int | None = None


class _Read(NamedTuple):
    time_ns: int
    vector: Vector3


class PhoneStream:
    """Takes messages as they come; gives the samples that they complete, in order. Plain state.

    A sample is the accelerometer's; other sensors are interpolated at its time, so it waits until
    they have got that far. Where the app sends force without gravity, gravity is added.
    """

    def __init__(self) -> None:
        self._read: dict[str, deque[_Read]] = {
            name: deque(maxlen=MOST_READINGS) for name in SENSORS
        }
        self._newest_ns: dict[str, int] = {}
        self._begin_ns: int | None = None
        self._session_id = ""
        self._message_id: int | None = None
        self._left: deque[str] = deque(maxlen=MOST_SESSIONS)

    def is_displaced(self, push: PhonePush) -> bool:
        """Whether a message is of a session after which another has begun: of another phone."""
        return push.session_id in self._left

    def begins(self, push: PhonePush) -> bool:
        """Whether a message is the first of its session, and there was one before."""
        return bool(self._session_id) and push.session_id not in (self._session_id, *self._left)

    def is_next(self, push: PhonePush) -> bool:
        """Whether a message is later than all of its session so far; remember it, if it is.

        Another has been taken already, or its readings are too late to be.
        """
        if push.session_id != self._session_id:
            if self._session_id:
                self._left.append(self._session_id)
            self._session_id, self._message_id = push.session_id, None
        newest, told = self._message_id, push.message_id
        if newest is not None and told is not None and told <= newest:
            return False
        self._message_id = told
        return True

    def take(self, push: PhonePush) -> list[ImuSample]:
        """Take in a message; return what is complete by now."""
        for reading in push.payload:
            vector = _vector(reading.values)
            if vector is not None and reading.name.lower() in self._read:
                self._note(reading.name.lower(), _Read(reading.time, vector))
        samples = []
        while (sample := self._next()) is not None:
            samples.append(sample)
        return samples

    def _note(self, name: str, reading: _Read) -> None:
        """Keep a reading, unless it is late; begin anew if the phone's clock was set back."""
        newest_ns = self._newest_ns.get(name)
        if newest_ns is not None and newest_ns - PATIENCE_NS < reading.time_ns <= newest_ns:
            return
        if newest_ns is not None and reading.time_ns <= newest_ns:
            self._begin_ns = None
            self._newest_ns.clear()
            for read in self._read.values():
                read.clear()
        if self._begin_ns is None:
            self._begin_ns = reading.time_ns
        self._newest_ns[name] = reading.time_ns
        self._read[name].append(reading)

    def _next(self) -> ImuSample | None:
        """Return the next sample, if all that it needs is there."""
        has_total = TOTAL in self._newest_ns
        name, needed = (TOTAL, []) if has_total else (MOVED, [GRAVITY])
        forces = self._read[name]
        if not forces or any(self._awaits(other, name) for other in (*needed, RATE, FIELD)):
            return None
        time_ns, (x, y, z) = forces.popleft()
        if needed:
            gravity = _at(self._read[GRAVITY], time_ns)
            if gravity is None:
                return None
            x, y, z = x + gravity[0], y + gravity[1], z + gravity[2]
        rate = _at(self._read[RATE], time_ns, SILENT_NS)
        field = _at(self._read[FIELD], time_ns)
        return ImuSample(time_ns, (x, y, z), rate or WITHOUT_GYRO, field)

    def _awaits(self, name: str, force: str) -> bool:
        """Whether a sensor may yet tell of the next sample; not for long, if it falls silent."""
        next_ns, newest_ns = self._read[force][0].time_ns, self._newest_ns[force]
        own_ns = self._newest_ns.get(name, (self._begin_ns or 0) - 1)
        return own_ns < next_ns and newest_ns - own_ns < PATIENCE_NS


def decoded(body: bytes | str) -> PhonePush:
    """Return the message in ``body``; raise ``ValueError`` if it is none."""
    try:
        push = msgspec.json.decode(body, type=PhonePush)
    except (msgspec.DecodeError, RecursionError) as error:
        raise ValueError(f"not a phone's message: {error}") from None
    for name in SENSORS:
        times_ns = [reading.time for reading in push.payload if reading.name.lower() == name]
        periods = len(times_ns) - 1
        if periods < FEWEST_TO_TIME:
            continue
        if max(times_ns) - min(times_ns) < periods * SHORTEST_PERIOD_NS:
            raise ValueError(
                f"{name}: times are not in nanoseconds: use 'Sensor Logger' or our page"
            )
    return push


def unreadable(push: PhonePush) -> set[str]:
    """Return the sensors of which a message has readings, and none with numbers x, y and z."""
    told = [reading for reading in push.payload if reading.name.lower() in SENSORS]
    read = {reading.name for reading in told if _vector(reading.values) is not None}
    return {reading.name for reading in told} - read


def reads_upside_down(samples: Sequence[ImuSample]) -> bool:
    """Whether a phone reads as if held by its top, its screen looking down.

    Nobody looks at one so who has just begun to send: its forces are of the opposite sign.
    """
    up_screen_m_s2, out_of_screen_m_s2 = (
        fmean(one.force_m_s2[axis] for one in samples) for axis in (1, 2)
    )
    return max(up_screen_m_s2, out_of_screen_m_s2) < 0.0 and (
        min(up_screen_m_s2, out_of_screen_m_s2) < -SURELY_UPSIDE_DOWN_M_S2
    )


def speeds_of(push: PhonePush) -> list[SpeedReading]:
    """Return the speeds that a message tells, as satellites have them."""
    speeds = []
    for reading in push.payload:
        speed_m_s, sd_m_s = (reading.values.get(name) for name in ("speed", "speedAccuracy"))
        if reading.name.lower() == LOCATION and isinstance(speed_m_s, Number):
            known_m_s = sd_m_s if isinstance(sd_m_s, Number) else math.nan
            speeds.append(speed_reading(reading.time, speed_m_s, known_m_s))
    return [one for one in speeds if one is not None]


def _vector(values: dict[str, object]) -> Vector3 | None:
    x, y, z = (values.get(axis) for axis in "xyz")
    if not (isinstance(x, Number) and isinstance(y, Number) and isinstance(z, Number)):
        return None
    try:
        return float(x), float(y), float(z)
    except OverflowError:
        return None


def _at(read: deque[_Read], time_ns: int, within_ns: int = PATIENCE_NS) -> Vector3 | None:
    """Return a sensor's vector at ``time_ns``, and forget what was before.

    ``None`` if nothing was read ``within_ns``.
    """
    while len(read) > 1 and read[1].time_ns <= time_ns:
        read.popleft()
    if not any(abs(one.time_ns - time_ns) <= within_ns for one in islice(read, 2)):
        return None
    if len(read) == 1 or time_ns <= read[0].time_ns:
        return read[0].vector
    (before_ns, (ax, ay, az)), (after_ns, (bx, by, bz)) = read[0], read[1]
    share = (time_ns - before_ns) / (after_ns - before_ns)
    return ax + share * (bx - ax), ay + share * (by - ay), az + share * (bz - az)
