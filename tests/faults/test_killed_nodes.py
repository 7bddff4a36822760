"""Nodes that are killed over and over: what they said is there, once, and they go on from now."""

from __future__ import annotations

import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from functools import partial
from pathlib import Path

import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from shared.bus.interface import Received
from shared.bus.zenoh_bus import ZenohBus, open_zenoh
from shared.codec import Refusal, decode, encode, message_of, parse_key
from shared.gate import Gate
from shared.messages import DapInstallation, ExerciseStart, Message, OdometryIncrement, TrackStart
from shared.process import ExitCode
from shared.topics import alive_key, everything_of
from tests.bus.relay import Relay
from tests.bus.test_zenoh import port_of
from tests.faults.hearing import Hearing, strides_in
from tests.waiting import DEADLINE_S, wait_for

FIRE = "fire"


@contextmanager
def running(*command: str) -> Iterator[subprocess.Popen[bytes]]:
    """Run a Python module, whose standard input stays open, until the end of the block."""
    process = subprocess.Popen([sys.executable, "-m", *command], stdin=subprocess.PIPE)
    try:
        yield process
    finally:
        process.kill()
        process.communicate()


def kill(process: subprocess.Popen[bytes]) -> None:
    process.send_signal(signal.SIGKILL)
    process.wait()


def test_an_agent_killed_out_of_reach_over_and_over_loses_nothing(
    tmp_path: Path, benchmark: BenchmarkFixture
) -> None:
    """A hundred times with benchmarks enabled."""
    journal, times = tmp_path / "r1", 100 if benchmark.enabled else 4
    with (
        open_zenoh("router", listen=["tcp/127.0.0.1:0"]) as router,
        Hearing(router, FIRE) as hearing,
        Relay(port_of(router.locators()[0])) as relay,
    ):
        endpoint = f"tcp/127.0.0.1:{relay.port}"
        talk = ("tests.faults.talker", endpoint, FIRE, "r1", str(journal))

        def kill_often() -> None:
            for _ in range(times):
                relay.mend()
                with running(*talk, "200") as talker:
                    enough = hearing.count("r1") + 20
                    wait_for(partial(hearing.has_heard, "r1", enough), "strides", 60.0)
                    relay.cut()
                    threading.Event().wait(0.3)
                    kill(talker)

        benchmark.pedantic(kill_often, rounds=1, iterations=1)  # type: ignore[no-untyped-call]
        relay.mend()
        with running(*talk, "1"):
            before = hearing.count("r1")
            wait_for(lambda: hearing.count("r1") > before + 1, "two more", 60.0)
            wait_for(lambda: not hearing.missing({}), "all that was missed")
        said = strides_in(journal)
        assert len(said) > 20 * times
        assert said == set(hearing.came["r1"])
        assert not hearing.again
        assert hearing.collector.counts["refilled"] > 5 * times
        assert len(list(hearing.gate.journals())) == 1
        benchmark.extra_info.update(said=len(said), refilled=hearing.collector.counts["refilled"])


class Exercise:
    """A simulated exercise that somebody gives, and what all of its nodes say."""

    def __init__(self, opened: ExitStack, scenario: str, speed: float) -> None:
        self._opened = opened
        self._scenario = scenario
        self.speed = speed
        self.bus: ZenohBus = opened.enter_context(open_zenoh("router", listen=["tcp/127.0.0.1:0"]))
        self.endpoint = self.bus.locators()[0]
        self._heard: list[Received] = []
        self._alive: set[str] = set()
        self._gate = Gate()
        self.bus.subscribe(everything_of(FIRE), self._heard.append)
        self.bus.watch_alive("clew/v1/fire/*/*/alive", self._note)
        self.start_ns = 0

    def _note(self, key: str, is_alive: bool) -> None:
        (self._alive.add if is_alive else self._alive.discard)(key)

    def await_alive(self, role: str, node_id: str) -> None:
        """Wait until a node is there."""
        key = alive_key(FIRE, role, node_id)  # type: ignore[arg-type]
        wait_for(lambda: key in self._alive, f"{node_id} to be alive", 60.0)

    def begin(self) -> None:
        """Give the start."""
        self.start_ns = time.time_ns()
        start = encode(
            ExerciseStart(
                event_time_ns=self.start_ns, sequence=0, scenario=self._scenario, seed=1,
                speed=self.speed,
            )
        )  # fmt: skip
        self.bus.answer("clew/v1/fire/post/launcher/exercise", lambda _: start)

    def now_ns(self) -> int:
        """What time it is in the exercise."""
        return self.start_ns + round((time.time_ns() - self.start_ns) * self.speed)

    def heard(self, kind: type[Message]) -> list[Message]:
        """Return what was heard of one kind, in order."""
        found = []
        for received in tuple(self._heard):
            message = message_of(received.key, received.payload)
            if type(message) is kind:
                found.append(message)
        return found


@pytest.fixture
def exercise() -> Iterator[Exercise]:
    with ExitStack() as opened:
        yield Exercise(opened, "four_daps", 4.0)


def node(exercise: Exercise, program: str, node_id: str, journal: Path) -> tuple[str, ...]:
    return (
        program, "run", "--id", node_id, "--incident", FIRE, "--insecure", "--await-start",
        "--connect", exercise.endpoint, "--journal", str(journal),
        "--source", "simulated:four_daps",
    )  # fmt: skip


def test_an_agent_killed_midway_goes_on_from_now(exercise: Exercise, tmp_path: Path) -> None:
    journal = tmp_path / "r1"
    command = node(exercise, "edge_agent", "r1", journal)
    with running(*command) as agent:
        exercise.await_alive("responder", "r1")
        exercise.begin()
        wait_for(lambda: len(exercise.heard(OdometryIncrement)) >= 3, "strides", 60.0)
        kill(agent)
    killed_ns = exercise.now_ns()
    before = len(exercise.heard(OdometryIncrement))
    with running(*command) as agent:
        wait_for(lambda: len(exercise.heard(OdometryIncrement)) > before, "strides again", 60.0)
        agent.send_signal(signal.SIGTERM)
        assert agent.wait(DEADLINE_S) == ExitCode.OK
    strides = exercise.heard(OdometryIncrement)
    assert all(stride.event_time_ns > killed_ns for stride in strides[before:])
    assert strides[before].sequence == 0
    first, *_, last = exercise.heard(TrackStart)
    assert isinstance(first, TrackStart)
    assert isinstance(last, TrackStart)
    assert first.position is not None
    assert last.position is None
    assert last.event_time_ns > killed_ns
    assert len(strides_in(journal)) == len(strides)


def test_a_dap_killed_midway_knows_where_it_stands(exercise: Exercise, tmp_path: Path) -> None:
    command = node(exercise, "dap_node", "dap1", tmp_path / "dap1")
    with running(*command) as dap:
        exercise.await_alive("dap", "dap1")
        exercise.begin()
        wait_for(lambda: exercise.heard(DapInstallation), "the installation", 60.0)
        kill(dap)
    (said,) = exercise.heard(DapInstallation)
    with running(*command):
        exercise.await_alive("dap", "dap1")

        def answers() -> list[Message | Refusal]:
            replies = exercise.bus.query("clew/v1/fire/dap/dap1/installation", 2.0)
            return [decode(parse_key(each.key), each.payload) for each in replies]  # type: ignore[arg-type]

        wait_for(answers, "an answer")
        assert answers() == [said]
    assert exercise.heard(DapInstallation) == [said]
