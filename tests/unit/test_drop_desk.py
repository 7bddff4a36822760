"""A wearer with DAPs is told when to set one down, the post as well, and boxes are counted."""

from __future__ import annotations

import pytest

from edge_agent.drop_desk import Beacon, DropDesk, tell_wearer_to_set_down
from edge_agent.sources.simulated_cues import simulated_beacons
from shared.bus.memory import MemoryNetwork
from shared.codec import decode, parse_key
from shared.drop_adviser import Advice
from shared.messages import DropAdvice
from shared.sender import Sender
from shared.simulation.scenario import load_scenario
from shared.topics import Key
from tests.stride_world import START_NS, stride

STRIDE_M = 1.2


class _Unit:
    """A unit on a network that carries DAPs, and what it is heard to say."""

    def __init__(self, boxes: int) -> None:
        network = MemoryNetwork()
        self.told: list[Advice] = []
        self.heard: list[DropAdvice] = []
        post = network.connect()
        post.subscribe("clew/v1/fire/responder/r1/advice", lambda got: self._hear(*got))
        own = network.connect()
        self.desk = DropDesk(Sender(own, "fire", "responder", "r1"), boxes, self.told.append)
        self._steps = 0

    def _hear(self, key_text: str, payload: bytes) -> None:
        key = parse_key(key_text)
        assert isinstance(key, Key)
        said = decode(key, payload)
        assert isinstance(said, DropAdvice)
        self.heard.append(said)

    def hear(self, dap_id: str, rssi_dbm: float) -> None:
        next_ns = START_NS + round(1.1e9 * (self._steps + 1))
        self.desk.hear(Beacon(next_ns - 1, dap_id, rssi_dbm))

    def go(self, north: int, east: int, count: int) -> None:
        for _ in range(count):
            self._steps += 1
            self.desk.move(
                stride(
                    1.1 * self._steps, STRIDE_M * north, STRIDE_M * east, sequence=self._steps
                )
            )  # fmt: skip


def test_the_wearer_and_the_post_are_told_the_same_once() -> None:
    unit = _Unit(2)
    unit.go(1, 0, 16)
    unit.go(0, 1, 2)
    (advice,), (said,) = unit.told, unit.heard
    assert (said.urgency, said.reason, said.boxes_left) == (advice.urgency, advice.reason, 2)


def test_a_new_dap_where_one_was_asked_for_is_one_box_less() -> None:
    unit = _Unit(1)
    unit.go(1, 0, 16)
    unit.go(0, 1, 2)
    assert len(unit.told) == 1
    unit.hear("dap9", -45.0)
    unit.go(0, 1, 20)
    unit.go(1, 0, 20)
    assert len(unit.told) == 1


def test_daps_that_are_loud_are_near_enough() -> None:
    unit = _Unit(2)
    for step in range(1, 18):
        unit.hear("dap1", -55.0)
        unit.go(*((1, 0, 1) if step < 16 else (0, 1, 1)))
    assert unit.told == []


def test_a_simulated_unit_hears_daps_in_the_order_of_time() -> None:
    beacons = list(simulated_beacons(load_scenario("corridor"), "r1", 1))
    times = [beacon.time_ns for beacon in beacons]
    assert times == sorted(times)
    assert max(beacon.rssi_dbm for beacon in beacons) > -50.0


def test_the_wearer_reads_where_and_why(capsys: pytest.CaptureFixture[str]) -> None:
    tell_wearer_to_set_down(Advice(0, 0.8, "at a junction, 21 m since the last DAP"))
    assert "SET A DAP DOWN: at a junction, 21 m" in capsys.readouterr().out
