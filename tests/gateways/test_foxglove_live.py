"""Foxglove looking in: a WebSocket client of its protocol sees what the post says."""

from __future__ import annotations

import json
import struct
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest

from command_post.commands.doors import Doors
from command_post.gateways import foxglove_live
from command_post.gateways.foxglove_live import (
    FoxgloveDoor,
    foxglove_address,
    foxglove_served,
)
from command_post.listening import Address
from command_post.roster import Roster
from shared.codec import encode
from shared.geodesy import Origin
from tests.gateways.test_cot import alert
from tests.gateways.test_foxglove import SAID, track
from tests.waiting import wait_for

sync = pytest.importorskip("websockets.sync.client")

KEY = "clew/v1/fire/post/post/"
ORIGIN = Origin(latitude_deg=37.5, longitude_deg=127.0)
DEADLINE_S = 60.0
BACKLOG, MOST_WAITING = 256, 2000


class Viewer:
    """Looks in by the protocol ``foxglove.sdk.v1``, and asks for all there is."""

    def __init__(self, socket: Any) -> None:
        self.socket = socket
        self.server: dict[str, Any] = json.loads(socket.recv(DEADLINE_S))
        self.channels: dict[int, dict[str, Any]] = {}

    def sees(self, topic: str) -> dict[str, Any]:
        """Return the next message on a topic."""
        while True:
            said = self.socket.recv(DEADLINE_S)
            if isinstance(said, bytes):
                opcode, number, _ = struct.unpack_from("<BIQ", said)
                assert opcode == 1
                if self.channels[number]["topic"] == topic:
                    found: dict[str, Any] = json.loads(said[13:])
                    return found
            else:
                self._heed(json.loads(said))

    def sees_channel(self, topic: str) -> bool:
        """Ask for what is advertised, until a channel of a topic is."""
        while not any(each["topic"] == topic for each in self.channels.values()):
            said = self.socket.recv(DEADLINE_S)
            if isinstance(said, str):
                self._heed(json.loads(said))
        return True

    def _heed(self, told: dict[str, Any]) -> None:
        if told["op"] == "advertise":
            self.channels |= {each["id"]: each for each in told["channels"]}
            self._ask_for([each["id"] for each in told["channels"]])
        elif told["op"] == "status" and "nknown channel" in told["message"]:
            # The server advertises a channel a moment before it knows of it.
            self._ask_for([int(told["message"].rpartition(" ")[2])])

    def _ask_for(self, numbers: list[int]) -> None:
        wanted = [{"id": number, "channelId": number} for number in numbers]
        self.socket.send(json.dumps({"op": "subscribe", "subscriptions": wanted}))


@pytest.fixture(autouse=True)
def _in_small(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(foxglove_live, "AGAIN_S", 0.3)
    monkeypatch.setattr(foxglove_live, "BACKLOG", BACKLOG)
    monkeypatch.setattr(foxglove_live, "MOST_WAITING", MOST_WAITING)


@contextmanager
def viewer(served: FoxgloveDoor, most_unread: int | None = None) -> Iterator[Viewer]:
    with sync.connect(
        f"ws://127.0.0.1:{served.port}", subprotocols=["foxglove.sdk.v1"], max_size=None,
        max_queue=most_unread, close_timeout=0.1,
    ) as socket:  # fmt: skip
        yield Viewer(socket)


@contextmanager
def door() -> Iterator[FoxgloveDoor]:
    with foxglove_served(Address("127.0.0.1", 0), "fire", ORIGIN) as served:
        assert served is not None
        yield served


def test_who_looks_in_sees_people_a_map_and_the_log() -> None:
    with door() as served:
        served.published(f"{KEY}track", encode(track()))
        served.published(f"{KEY}beat", b"no picture of that")
        served.published(f"{KEY}alert", b"nor of this")
        with viewer(served) as seen:
            assert seen.server["name"] == "Clew fire"
            # Nothing can be said by it.
            assert seen.server["capabilities"] == []
            # Who comes late sees what stands.
            assert seen.sees("/responders/r1/scene")["entities"][0]["id"] == "r1"
            place = seen.sees("/responders/r1/location")
            assert place["latitude"] == pytest.approx(37.5, abs=1e-3)
            assert "FeatureCollection" in seen.sees("/map")["geojson"]
            served.published(f"{KEY}alert", alert("resolved"))
            assert seen.sees("/log")["message"] == "mayday r1 resolved: calls mayday"
            names = {each["topic"]: each["schemaName"] for each in seen.channels.values()}
            assert names["/map"] == "foxglove.GeoJSON"
            assert names["/log"] == "foxglove.Log"
    assert not any(thread.name == "foxglove" for thread in threading.enumerate())


def test_an_access_point_that_the_roster_has_no_more_is_taken_away() -> None:
    with door() as served:
        served.published(f"{KEY}dap_place", encode(SAID[2]))
        with viewer(served) as seen:
            assert seen.sees("/daps/d1")["entities"][0]["id"] == "d1"
            served.show(Roster(0, (), ()))
            while not seen.sees("/daps/d1")["deletions"]:
                pass


def test_a_slow_client_holds_up_nobody() -> None:
    with door() as served, viewer(served, most_unread=1) as slow, viewer(served) as quick:
        for each in (slow, quick):
            each.sees_channel("/log")
        wait_for(lambda: "/log" in served.watched, "the log to be looked at")
        # More than is kept for anybody.
        for _ in range(2 * BACKLOG + MOST_WAITING):
            served.published(f"{KEY}alert", alert("acknowledged"))
        served.published(f"{KEY}track", encode(track()))
        assert quick.sees("/responders/r1/frame")["child_frame_id"] == "r1"


def test_it_is_for_this_machine_alone() -> None:
    with pytest.raises(ValueError, match="a tunnel: ssh -L"):
        foxglove_address("0.0.0.0:8765")
    with pytest.raises(ValueError, match="HOST:PORT"):
        Doors(foxglove="8765").check(None, "post")
    assert foxglove_address("127.0.0.1:8765").port == 8765


def test_where_somebody_listens_already_it_says_so() -> None:
    with door() as served, pytest.raises(OSError, match=f"127.0.0.1:{served.port}"):
        FoxgloveDoor(Address("127.0.0.1", served.port), "fire", None)
