"""Who is silent may be walking: how sure it is where they are shrinks from the first missed beats.

A walker of 1.2 m/s is the measure: wherever the way leads, the truth has to be in what is told.
"""

from __future__ import annotations

import math

import msgspec
import numpy as np
import pytest

from command_post.fusion.settings import FusionSettings
from command_post.incident import Incident, IncidentSettings
from shared.codec import encode
from shared.messages import Beat, Message, TrackEstimate
from shared.seal import sealed
from shared.topics import Role
from tests.stride_world import (
    STRIDE_M,
    STRIDE_S,
    at_ns,
    installation,
    key_of,
    stride,
    track_start,
)
from tests.unit.test_incident import decoded
from tests.unit.test_team_tracker import peak_at

RUN = bytes(range(8))
BEAT_S = 0.5
REACH = math.sqrt(5.99)
"""In standard deviations, of the 95 % region of a Gaussian in the plane."""

WALKED_S = 10.0
SPEED_M_S = STRIDE_M / STRIDE_S


class Unit:
    """One responder's unit and the post: what is said of them is in ``told``."""

    def __init__(self, *, beats: bool = True) -> None:
        self.incident = Incident(IncidentSettings(fusion=FusionSettings()))
        self.told: list[TrackEstimate] = []
        self._beats = beats
        self._number = 0
        self._say(track_start(0.0, heading_sd_rad=0.05), 0.0)
        time_s, beat_s = 0.0, 0.0
        while time_s + STRIDE_S < WALKED_S:
            time_s += STRIDE_S
            while beat_s < time_s:
                self.beat(beat_s)
                beat_s += BEAT_S
            self.stride(time_s)

    def stride(self, time_s: float, heard_s: float | None = None) -> None:
        """Say a stride that ended at ``time_s``, heard then or later."""
        self._say(
            stride(time_s, STRIDE_M, 0.0, sequence=self._number),
            time_s if heard_s is None else heard_s,
        )

    def lose(self) -> None:
        """Have a stride in the journal that does not come."""
        self._number += 1

    def beat(self, time_s: float, followed_s: float | None = None) -> None:
        """Say what the journal holds, and until when the wearer was followed."""
        if self._beats:
            self._hear(
                Beat(
                    event_time_ns=at_ns(time_s), sequence=round(time_s / BEAT_S), run=RUN.hex(),
                    last_number=self._number, kept_from=1, acknowledged=0,
                    followed_until_ns=None if followed_s is None else at_ns(followed_s),
                ),
                time_s,
            )  # fmt: skip

    def beat_until(self, time_s: float, followed_s: float | None = None) -> None:
        """Beat as a unit does whose wearer has stopped."""
        for number in range(round(WALKED_S / BEAT_S), round(time_s / BEAT_S) + 1):
            self.beat(number * BEAT_S, followed_s)

    def pass_time(self, time_s: float) -> TrackEstimate:
        """Let time pass with nothing said; return what was told last."""
        self._take(self.incident.pass_time(at_ns(time_s)))
        return self.told[-1]

    def is_told_of(self, role: Role, node_id: str, message: Message, heard_s: float) -> None:
        """Have somebody else say something."""
        self._hear(message, heard_s, key=str(key_of(role, node_id, type(message))))

    def _say(self, message: Message, heard_s: float) -> None:
        self._number += 1
        self._hear(message, heard_s, sealed(encode(message), RUN, self._number))

    def _hear(
        self, message: Message, heard_s: float, payload: bytes | None = None, key: str | None = None
    ) -> None:
        key = key or str(key_of("responder", "r1", type(message)))
        payload = encode(message) if payload is None else payload
        self._take(self.incident.handle(key, payload, at_ns(heard_s)))

    def _take(self, outgoing: list) -> None:  # type: ignore[type-arg]
        messages = map(decoded, outgoing)
        self.told += [each for each in messages if isinstance(each, TrackEstimate)]


def reach_m(told: TrackEstimate) -> float:
    """Return how far from its middle the told region holds a place, in its narrowest direction."""
    nn, ne, ee = told.covariance_m2
    middle, half = 0.5 * (nn + ee), math.hypot(0.5 * (nn - ee), ne)
    return REACH * math.sqrt(middle - half)


@pytest.mark.parametrize("silent_s", [5.0, 10.0, 30.0, 120.0])
def test_who_walks_on_unheard_is_in_the_region(silent_s: float) -> None:
    unit = Unit()
    told = unit.pass_time(WALKED_S + silent_s)
    assert told.event_time_ns > at_ns(WALKED_S + 0.8 * silent_s - 3.0)
    walked_m = SPEED_M_S * (told.event_time_ns - at_ns(WALKED_S)) / 1e9
    assert reach_m(told) > 0.9 * walked_m
    assert told.reason.startswith("nothing heard for")
    assert told.status == ("lost" if silent_s > 20.0 else "dead_reckoning")


def test_who_stands_and_beats_is_where_they_are() -> None:
    unit = Unit()
    unit.beat_until(60.0, followed_s=None)
    told = unit.pass_time(61.0)
    assert reach_m(told) < 3.0
    assert "nothing heard" not in told.reason


@pytest.mark.parametrize("followed_s", [None, 11.0])
def test_a_unit_that_beats_but_does_not_follow_is_no_standing_wearer(
    followed_s: float | None,
) -> None:
    """A stride that has not come, or a sensor that was not read: the beat tells of both."""
    unit = Unit()
    if followed_s is None:
        unit.lose()
    unit.beat_until(25.0, followed_s)
    told = unit.pass_time(25.2)
    assert reach_m(told) > 0.9 * SPEED_M_S * 12.0


def test_what_was_on_its_way_comes_and_all_is_well() -> None:
    unit = Unit()
    unit.lose()
    unit.beat_until(20.0)
    lost = unit.pass_time(20.2)
    unit._number -= 1
    unit.stride(11.0, heard_s=20.3)
    unit.beat_until(21.0)
    told = unit.pass_time(21.4)
    assert reach_m(told) < 3.0 < reach_m(lost)
    assert told.north_m > lost.north_m + 0.5 * STRIDE_M


def test_late_strides_do_not_set_anybody_back_in_time() -> None:
    unit = Unit()
    unit.pass_time(25.0)
    before_ns = unit.told[-1].event_time_ns
    for late in range(1, 8):
        unit.stride(WALKED_S + late * STRIDE_S, heard_s=25.0 + 0.01 * late)
    told = unit.pass_time(25.2)
    assert [each.event_time_ns >= before_ns for each in unit.told[-7:]] == [True] * 7
    # What is not known of is shorter now.
    assert 0.9 * SPEED_M_S * 15.0 * 0.4 < reach_m(told) < 15.0


def test_who_does_not_beat_may_stand_and_say_nothing() -> None:
    unit = Unit(beats=False)
    assert reach_m(unit.pass_time(WALKED_S + 19.0)) < 3.0
    told = unit.pass_time(WALKED_S + 60.0)
    assert told.status == "lost"
    assert reach_m(told) > 30.0


def test_the_longer_one_is_silent_the_rarer_it_is_told() -> None:
    unit = Unit()
    unit.pass_time(24.0 * 3600.0)
    assert len(unit.told) < 150
    late_ns = [each.event_time_ns for each in unit.told[-3:]]
    assert late_ns[2] - late_ns[1] > late_ns[1] - late_ns[0] > 3600e9


def test_whenever_time_is_asked_the_same_is_told_of_who_is_silent_and_heard() -> None:
    """A DAP hears them time and again; then a stride comes of when the silence began."""

    def told(asked_s: list[float]) -> list[TrackEstimate]:
        unit = Unit()
        unit.is_told_of("dap", "dap1", installation(0.0, None, (20.0, 15.0)), WALKED_S)
        before_s = 0.0
        for number, heard_s in enumerate((20.0, 24.0, 31.0, 33.0, 35.0)):
            for time_s in (each for each in asked_s if before_s < each < heard_s):
                unit.pass_time(time_s)
            if heard_s < 35.0:
                passed = msgspec.structs.replace(peak_at(heard_s - 0.2, "r1"), sequence=number + 1)
                unit.is_told_of("dap", "dap1", passed, heard_s)
            else:
                unit.stride(WALKED_S + STRIDE_S, heard_s)
            before_s = heard_s
        unit.pass_time(40.0)
        return unit.told

    once = told([])
    # The last of what was heard is taken in with what comes after.
    assert once[-1].reason == "nothing heard for 27 s, but by dap1 7 s ago"
    assert math.hypot(once[-1].north_m - 20.0, once[-1].east_m - 15.0) < 1.5
    assert told(np.arange(WALKED_S, 40.0, 0.3).tolist()) == once
