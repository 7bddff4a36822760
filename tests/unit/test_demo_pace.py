"""A demo too fast for its machine: that is said, once."""

from __future__ import annotations

from pathlib import Path

import pytest
from msgspec import structs

from command_post.demo import INCIDENT, watch_the_pace, why_told_late
from command_post.demo_settings import DemoSettings
from shared.bus.memory import MemoryNetwork
from shared.clock import SystemClock
from shared.codec import encode
from shared.mcap_reader import RecordedMessage
from shared.messages import ExerciseStart
from shared.simulation.scenario import load_scenario
from shared.topics import Key
from shared.units import NS_PER_S
from tests.stride_world import stride
from tests.waiting import wait_for


def demo_at(speed: float) -> DemoSettings:
    return DemoSettings(
        "corridor", load_scenario("corridor"), 1, speed, None, Path(), shows_table=False
    )


@pytest.mark.parametrize(("late_s", "told"), [(3.0, 0), (3000.0, 1)])
def test_falling_behind_is_said_once(late_s: float, told: int) -> None:
    settings = demo_at(2.0)
    now_ns = SystemClock().now_ns()
    start = ExerciseStart(event_time_ns=now_ns, sequence=0, scenario="corridor", seed=1, speed=2.0)
    said: list[str] = []
    heard: list[object] = []
    key = str(Key(INCIDENT, "responder", "r1", "increment"))
    with MemoryNetwork().connect() as bus:
        watch_the_pace(settings, bus, start, said.append)
        bus.subscribe(key, heard.append)
        made_ns = now_ns - round(late_s * NS_PER_S)
        late = encode(structs.replace(stride(0.0, 1.2, 0.0), event_time_ns=made_ns))
        bus.publish(key, b"no message")
        bus.publish(key, late)
        bus.publish(key, late)
        wait_for(lambda: len(heard) == 3, "all that was published")
    assert len(said) == told
    assert all("this machine falls behind at 2x: r1 is " in each for each in said)


@pytest.mark.parametrize(("late_s", "behind"), [(5.0, None), (61.0, "fell 61 s behind at 10x")])
def test_a_post_that_did_not_keep_up_says_why_its_score_is_worse(
    late_s: float, behind: str | None
) -> None:
    def came(topic: str, after_s: float) -> RecordedMessage:
        key = str(Key(INCIDENT, "responder", "r1", topic))
        return RecordedMessage(round((9.0 + after_s) * NS_PER_S), 9 * NS_PER_S, key, b"", False)

    # The truth of a whole walk, say, waits for nothing.
    recording = [came("increment", 1.0), came("increment", late_s), came("truth", 500.0)]
    said = why_told_late(recording, demo_at(10.0))
    assert said is None if behind is None else said is not None and behind in said
