"""At the post what is said now is handled before what was missed and is told again."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from threading import Event, Semaphore, Thread

from command_post.desks.announcer import Outgoing
from command_post.incident import Incident
from command_post.post import Post
from command_post.recorder.recording import Recorder
from shared.bus.memory import MemoryNetwork
from shared.clock import ManualClock
from tests.bus.test_refilling import Node
from tests.unit.test_post import NOW_NS, SETTINGS
from tests.waiting import DEADLINE_S, wait_for

STRIDES = 50


class SlowIncident(Incident):
    """Handles a stride whenever it is let."""

    def __init__(self) -> None:
        super().__init__(SETTINGS)
        self.may = Semaphore(0)
        self.handled: list[str] = []

    def handle(self, key: str, payload: bytes, now_ns: int) -> list[Outgoing]:
        """Handle what comes; a stride takes as long as the test wants."""
        topic = key.rpartition("/")[2]
        if topic == "increment":
            assert self.may.acquire(timeout=DEADLINE_S)
        self.handled.append(topic)
        return super().handle(key, payload, now_ns)

    def strides(self) -> int:
        """Return how many strides were handled."""
        return self.handled.count("increment")


def let(incident: SlowIncident, more: int) -> None:
    """Have so many more strides be handled."""
    until = incident.strides() + more
    incident.may.release(more)
    wait_for(lambda: incident.strides() == until, "the strides")


def is_heard(node: Node, incident: SlowIncident) -> bool:
    """Have a node beat; say whether anything has come of it."""
    node.heartbeat.beat()
    return bool(incident.handled)


def beats_after(handled: Sequence[str]) -> list[int]:
    """Return after how many strides each beat was handled."""
    return [handled[:at].count("increment") for at, topic in enumerate(handled) if topic == "beat"]


def test_a_beat_is_handled_amid_what_was_missed(tmp_path: Path) -> None:
    network, incident, stop = MemoryNetwork(), SlowIncident(), Event()
    node = Node(network, tmp_path)
    with node.outbox, node.bus, network.connect() as bus, Recorder(tmp_path / "a", {}) as recorder:
        node.say(*range(STRIDES))
        post = Post(
            bus, incident, recorder, ManualClock(NOW_NS), follows_exercise=False,
            show=lambda _: None,
        )  # fmt: skip
        serving = Thread(target=post.serve, args=(stop,))
        serving.start()
        try:
            wait_for(lambda: is_heard(node, incident), "a beat to be heard")
            # The first that was asked for, and some of the many that were asked for then.
            let(incident, 3)
            said = incident.handled.count("beat")
            node.heartbeat.beat()
            let(incident, 2)
            wait_for(lambda: incident.handled.count("beat") > said, "the beat")
            assert beats_after(incident.handled)[said] <= 5
            let(incident, STRIDES - 5)
        finally:
            incident.may.release(STRIDES)
            stop.set()
            serving.join()
    assert incident.strides() == STRIDES
