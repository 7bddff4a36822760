"""An agent at the level of strides, offline: messages as from a boot, times as its clock has it."""

from __future__ import annotations

from pathlib import Path

import pytest

from edge_agent.__main__ import app
from shared.bus.wire_log import read_wire_log
from shared.codec import Refusal, decode, parse_key
from shared.exercise import REHEARSAL_START_NS
from shared.messages import Message, OdometryIncrement, TrackStart, Truth
from shared.process import ExitCode
from shared.units import NS_PER_S

SCENARIO = """
description = "up the stairs and on"
plan = "course_building"
[odometry]
source = "strides"
[responders.r1]
start_m = [15.2, 24.0]
route = [
  { do = "stand", for_s = 5.0 },
  { do = "move", gait = "walk", to_m = [[15.2, 21.0]] },
  { do = "climb", stairs = "up" },
  { do = "move", gait = "crawl", to_m = [[15.2, 11.0]] },
  { do = "stand", for_s = 5.0 },
]
"""


def rehearsed(folder: Path, text: str, *options: str) -> list[tuple[int, Message]]:
    """Return what ``r1`` says, and when (ns of the exercise)."""
    folder.mkdir()
    path = folder / "mine.toml"
    path.write_text(text, encoding="utf-8")
    output = str(folder / "logs")
    arguments = ["rehearse", str(path), "--seeds", "4", "--no-imu", "--output", output, *options]
    assert app(arguments, result_action="return_value") == ExitCode.OK
    told: list[tuple[int, Message]] = []
    for frame in read_wire_log(folder / "logs" / "4" / "r1.wire"):
        key = parse_key(frame.key)
        assert not isinstance(key, Refusal)
        message = decode(key, frame.payload)
        assert not isinstance(message, Refusal)
        told.append((frame.time_ns - REHEARSAL_START_NS, message))
    return told


def test_the_scenario_says_that_strides_will_do(tmp_path: Path) -> None:
    told = rehearsed(tmp_path / "a", SCENARIO)
    assert told == rehearsed(tmp_path / "b", SCENARIO, "--odometry", "strides")
    times_ns = [time_ns for time_ns, _ in told]
    assert times_ns == sorted(times_ns)
    starts = [message for _, message in told if isinstance(message, TrackStart)]
    assert [start.method for start in starts] == ["strides"]
    strides = [message for _, message in told if isinstance(message, OdometryIncrement)]
    assert [stride.sequence for stride in strides] == list(range(len(strides)))
    assert {stride.activity for stride in strides} == {"walk", "stairs_up", "crawl"}
    climbed_m = -sum(stride.d_down_m for stride in strides)
    assert climbed_m == pytest.approx(3.3, abs=0.4)
    last = [message for _, message in told if isinstance(message, Truth)][-1]
    assert last.down_m == pytest.approx(-3.3)


def test_a_clock_that_is_ahead_dates_what_it_says_and_not_the_truth(tmp_path: Path) -> None:
    fault = "[faults.r1]\nclock_ahead_s = 2.0\n"
    right, wrong = (
        rehearsed(tmp_path / name, SCENARIO + text) for name, text in (("a", ""), ("b", fault))
    )
    for (time_ns, said), (same_ns, dated) in zip(right, wrong, strict=True):
        assert same_ns == time_ns
        ahead_ns = 0 if isinstance(said, Truth) else 2 * NS_PER_S
        assert dated.event_time_ns - said.event_time_ns == ahead_ns
