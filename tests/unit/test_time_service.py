"""Nodes ask the post what time it is: whom they believe, and what they state."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import msgspec
import pytest

from shared.bus.interface import Received
from shared.bus.memory import MemoryBus, MemoryNetwork
from shared.clock import ManualClock, PacedClock, SystemClock
from shared.security.verifier import KnownSigners
from shared.time_service import PATIENCE, TimeAnswer, TimeAsker, time_answerer
from shared.topics import time_key
from shared.units import NS_PER_S
from tests.faulty_clocks import FaultyClock
from tests.issued_keys import Keys, identity

START_NS = 1_700_000_000 * NS_PER_S
MS = 1_000_000


class SlowBus(MemoryBus):
    """A bus on which a question takes ``there_ns`` of ``steady``'s time, an answer ``back_ns``."""

    def __init__(
        self, network: MemoryNetwork, steady: ManualClock, there_ns: int, back_ns: int
    ) -> None:
        super().__init__(network)
        self._steady = steady
        self._ways_ns = (there_ns, back_ns)

    def query(self, key_expression: str, timeout_s: float, request: bytes = b"") -> list[Received]:
        """Put ``request`` to all, and take that long."""
        there_ns, back_ns = self._ways_ns
        self._steady.set_ns(self._steady.now_ns() + there_ns)
        answers = super().query(key_expression, timeout_s, request)
        self._steady.set_ns(self._steady.now_ns() + back_ns)
        return answers


class World:
    """A post whose clock is right, and a node whose clock is what a test makes it."""

    def __init__(self, wrong_by_ns: int, there_ns: int = 30 * MS, back_ns: int = 5 * MS) -> None:
        self.steady = ManualClock(START_NS)
        self.network = MemoryNetwork()
        self.post = PacedClock(SystemClock(0, self.steady.now_ns))
        self.clock = FaultyClock(wrong_by_ns, 0.0, self.steady.now_ns)
        self.node = PacedClock(self.clock)
        self.answer("post", self.post)
        self.asker = TimeAsker(
            SlowBus(self.network, self.steady, there_ns, back_ns), "test", self.node
        )

    def answer(self, post_id: str, clock: PacedClock) -> MemoryBus:
        """Have a post answer by ``clock``."""
        bus = self.network.connect()
        bus.answer(time_key("test", post_id), time_answerer(clock))
        return bus


@pytest.mark.parametrize("wrong_by_s", [0, -40, 3 * 3600, 86_400, -86_400])
@pytest.mark.parametrize(("there_ns", "back_ns"), [(30 * MS, 5 * MS), (0, 800 * MS), (0, 0)])
def test_a_node_finds_its_offset_however_uneven_the_ways(
    wrong_by_s: int, there_ns: int, back_ns: int
) -> None:
    world = World(wrong_by_s * NS_PER_S, there_ns, back_ns)
    assert world.asker.stated() is None
    assert world.asker.ask()
    stated = world.asker.stated()
    assert stated is not None
    assert stated.post_id == "post"
    off_ns = abs(stated.offset.offset_ns + wrong_by_s * NS_PER_S)
    assert off_ns <= stated.offset.uncertainty_ns
    assert stated.offset.uncertainty_ns == pytest.approx((there_ns + back_ns) / 2, abs=0.2 * MS)


def test_who_does_not_know_of_the_exercise_states_nothing() -> None:
    world = World(0)
    world.post.run_from(START_NS, 10.0)
    assert world.asker.post_time_ns("post") is None
    assert not world.asker.ask()
    assert world.asker.stated() is None
    # What time it is there is known all the same.
    at_post_ns = world.asker.post_time_ns("post")
    assert at_post_ns is not None
    assert START_NS <= at_post_ns < START_NS + 3600 * NS_PER_S
    world.node.run_from(START_NS, 10.0)
    assert world.asker.ask()
    stated = world.asker.stated()
    assert stated is not None
    # On the exercise's time line everything takes ten times as long, the ways too.
    assert stated.offset.uncertainty_ns == pytest.approx(175 * MS, abs=MS)
    assert abs(stated.offset.offset_ns) <= stated.offset.uncertainty_ns


def test_what_was_found_before_the_exercise_is_not_stated_in_it() -> None:
    world = World(0)
    assert world.asker.ask()
    world.node.run_from(START_NS, 10.0)
    assert world.asker.stated() is None


def test_one_post_is_kept_to_until_it_is_silent_for_long() -> None:
    world = World(0)
    assert world.asker.ask()
    other = FaultyClock(7 * NS_PER_S, 0.0, world.steady.now_ns)
    world.answer("another", PacedClock(other))
    assert world.asker.ask()
    stated = world.asker.stated()
    assert stated is not None
    assert stated.post_id == "post"
    world.network.answerers[:] = world.network.answerers[1:]
    for _ in range(PATIENCE):
        assert not world.asker.ask()
        assert world.asker.stated() is not None
    assert world.asker.ask()
    stated = world.asker.stated()
    assert stated is not None
    assert stated.post_id == "another"
    assert stated.offset.offset_ns == pytest.approx(7 * NS_PER_S, abs=20 * MS)


@pytest.mark.parametrize("request_", [b"", b"\xc1", b"\x91\xa1a", b"\x90", bytes(70_000)])
def test_what_is_no_question_has_no_answer(request_: bytes) -> None:
    assert time_answerer(PacedClock(ManualClock()))(request_) is None


def test_only_the_post_itself_turns_a_nodes_clock(tmp_path: Path) -> None:
    keys = Keys(tmp_path / "keys", ["post", "dap1", "r1"])
    world = World(0)
    world.network.answerers.clear()
    signers = KnownSigners(keys["r1"].authority, lambda: 0)
    asker = TimeAsker(world.network.connect(), "test", world.node, signers)
    key = time_key("test", "post")

    def said_by(name: str | None, under: str = key) -> bool:
        world.network.answerers.clear()
        sign = None if name is None else keys[name].sign
        world.network.connect().answer(key, time_answerer(world.post, under, sign))
        return asker.ask()

    assert not said_by("post")
    assert signers.take_wanted() == [identity("post")]
    for name in ("post", "dap1"):
        assert signers.learn(keys[name].certificate.der) is None
    assert [said_by("dap1"), said_by(None), said_by("post", "clew/v1/other/post/post/time")] == [
        False, False, False,
    ]  # fmt: skip
    assert asker.post_time_ns("post") is None
    assert said_by("post")
    assert asker.post_time_ns("post") is not None


def _garbage(_: int) -> bytes:
    return b"\xc1"


def _to_another_question(asked_ns: int) -> bytes:
    return msgspec.msgpack.encode(TimeAnswer(asked_ns - 1, START_NS, START_NS, 1.0))


def _back_in_time(asked_ns: int) -> bytes:
    return msgspec.msgpack.encode(TimeAnswer(asked_ns, START_NS, START_NS - NS_PER_S, 1.0))


@pytest.mark.parametrize("answer", [_garbage, _to_another_question, _back_in_time])
def test_an_answer_that_cannot_be_one_is_passed_over(answer: Callable[[int], bytes]) -> None:
    world = World(0)
    world.network.answerers.clear()
    world.network.connect().answer(
        time_key("test", "post"), lambda request: answer(msgspec.msgpack.decode(request)[0])
    )
    assert not world.asker.ask()
    assert world.asker.stated() is None
