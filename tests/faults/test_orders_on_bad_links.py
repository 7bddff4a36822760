"""Orders over a link that flaps: each is told once, and each acknowledgement arrives."""

from __future__ import annotations

import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import pytest

from command_post.going_on import Guest
from command_post.incident import Incident, IncidentSettings
from command_post.post import Post
from command_post.recorder.recording import Recorder
from command_post.roster import Roster
from edge_agent.order_desk import OrderDesk
from edge_agent.orders import OrderBook
from shared.bus.zenoh_bus import ZenohBus, open_zenoh
from shared.clock import SystemClock
from shared.gate import Gate
from shared.heartbeat import Heartbeat
from shared.messages import NodeHealth, Order, OrderRequest
from shared.outbox import JournalledOutbox
from shared.sender import Sender, Unkept
from shared.topics import alive_key
from tests.bus.relay import Relay
from tests.bus.test_zenoh import port_of
from tests.waiting import wait_for

FIRE = "fire"
FLAPS = 3
PATIENT_S = 90.0


@contextmanager
def post_at_work(bus: ZenohBus, path: Path, guests: Sequence[Guest] = ()) -> Iterator[list[Roster]]:
    """Let a post with ``guests`` serve on ``bus``; give what it shows."""
    shown, stop = list[Roster](), threading.Event()
    with Recorder(path, {}) as recorder:
        post = Post(
            bus, Incident(IncidentSettings(incident=FIRE)), recorder, SystemClock(),
            follows_exercise=False, show=shown.append, outbox=Unkept(), guests=guests,
        )  # fmt: skip
        thread = threading.Thread(target=post.serve, args=(stop,))
        thread.start()
        try:
            yield shown
        finally:
            stop.set()
            thread.join()


class Unit:
    """A responder's unit whose wearer acknowledges whatever they are told."""

    def __init__(self, bus: ZenohBus, outbox: JournalledOutbox) -> None:
        self.told: list[str] = []
        self._acknowledged = threading.Event()
        sender = Sender(bus, FIRE, "responder", "r1", outbox)
        clock = SystemClock()
        self.heartbeat = Heartbeat(bus, FIRE, "responder", "r1", outbox, now_ns=clock.now_ns)
        self.desk = OrderDesk(
            bus,
            FIRE,
            OrderBook("r1", "post"),
            sender,
            Gate(),
            clock,
            self._acknowledged,
            self._tell,
            lambda _: clock.now_ns(),
        )
        self._sender = sender
        bus.declare_alive(alive_key(FIRE, "responder", "r1"))

    def _tell(self, order: Order) -> None:
        self.told.append(order.text)
        self._acknowledged.set()

    def say_something(self) -> None:
        """Be heard."""
        number = self._sender.next_sequence(NodeHealth)
        now_ns = SystemClock().now_ns()
        self._sender.send(
            NodeHealth(event_time_ns=now_ns, sequence=number, level="ok", findings=())
        )


@pytest.mark.parametrize("delay_s", [0.05, 0.2])
def test_every_order_is_told_once_and_acknowledged_over_a_flapping_link(
    tmp_path: Path, delay_s: float
) -> None:
    with (
        open_zenoh("router", listen=["tcp/127.0.0.1:0"]) as router,
        post_at_work(router, tmp_path / "a.mcap") as shown,
        Relay(port_of(router.locators()[0]), delay_s, delay_s) as relay,
        JournalledOutbox(tmp_path / "r1.journal") as outbox,
        ZenohBus("client", [f"tcp/127.0.0.1:{relay.port}"], []) as bus,
    ):
        unit = Unit(bus, outbox)
        commander = Sender(router, FIRE, "post", "commander", Unkept())

        def is_heard() -> bool:
            unit.say_something()
            return bool(shown and shown[-1].responders)

        with unit.heartbeat, unit.desk:
            wait_for(is_heard, "the unit")
            for number in range(FLAPS):
                relay.cut()
                commander.send(
                    OrderRequest(
                        event_time_ns=SystemClock().now_ns(), sequence=number, kind="message",
                        to=("r1",), text=f"order {number}",
                    )
                )  # fmt: skip
                seen = len(shown)
                wait_for(lambda: len(shown) > seen + 4, "a second to pass")  # noqa: B023
                relay.mend()
                wait_for(bus.connected, "the link", PATIENT_S)
            wait_for(lambda: len(unit.told) == FLAPS, "all orders to be told", PATIENT_S)
            wait_for(lambda: not shown[-1].responders[0].orders, "all acknowledgements", PATIENT_S)
    assert sorted(unit.told) == [f"order {number}" for number in range(FLAPS)]
