"""What the page tells: made once for all who watch, and at nobody's pace but their own."""

from __future__ import annotations

import asyncio
import socket
import threading
from collections.abc import AsyncIterator, Iterator
from contextlib import contextmanager
from typing import NamedTuple

import msgspec
import pytest
from starlette.types import Message

from command_post.listening import Address
from command_post.web.app import Events, Frames, Site, make_app
from command_post.web.board import Board, Changes
from command_post.web.page import Page
from command_post.web.serving import LOCAL_NAMES, listening_at, serving_on
from tests.waiting import DEADLINE_S, wait_for
from tests.web.test_board import KEY, track

WATCHERS = 20
CROWD = 200


class _Told(msgspec.Struct):
    tracks: list[dict[str, object]] = []


class Watcher:
    """Somebody who watches, as slowly as they are read."""

    def __init__(self, address: Address) -> None:
        self._socket = socket.socket()
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        self._socket.settimeout(DEADLINE_S)
        self._socket.connect(address)
        request = f"GET /api/v1/events HTTP/1.1\r\nHost: 127.0.0.1:{address.port}\r\n\r\n"
        self._socket.sendall(request.encode())
        self._lines = self._socket.makefile("rb")
        self.frames = 0

    def sees(self, north_m: float) -> None:
        """Read until somebody is told to be there."""
        for line in self._lines:
            if line.startswith(b"data: "):
                self.frames += 1
                told = msgspec.json.decode(line[6:], type=_Told).tracks
                if any(each["north_m"] == north_m for each in told):
                    return
        raise AssertionError(f"the stream has ended before {north_m} was told")

    def close(self) -> None:
        """Hang up."""
        self._lines.close()
        self._socket.close()


class Serving(NamedTuple):
    """A page, and where it is served."""

    page: Page
    address: Address


@contextmanager
def serving() -> Iterator[Serving]:
    page = Page("test")
    site = Site("test", "post", page, None, secure=False, hosts=LOCAL_NAMES)
    with (
        listening_at(Address("127.0.0.1", 0)) as listening,
        serving_on(listening, lambda ends: make_app(site, ends), None),
    ):
        yield Serving(page, Address(*listening.getsockname()))


def crowd_at(page: Page, step: int, crowd: int = CROWD) -> float:
    """Have everybody be somewhere else; return where the last of them is."""
    for number in range(crowd):
        page.published(KEY, track(float(step), 1000.0 * step + number, f"r{number}"))
    return 1000.0 * step + crowd - 1


def test_what_many_watch_is_made_once(monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[int] = []
    since = Board.since

    def noted(board: Board, version: int) -> Changes:
        made.append(version)
        return since(board, version)

    monkeypatch.setattr(Board, "since", noted)
    page = Page("test")
    crowd_at(page, 1)
    frames = Frames(page)
    (told,) = {frames.since(0, 10.01) for _ in range(WATCHERS)}
    crowd_at(page, 2)
    assert {frames.since(0, 10.05)} == {told}, "until the next tick"
    (then,) = {frames.since(told[0], 10.15) for _ in range(WATCHERS)}
    assert then[0] > told[0]
    assert frames.since(0, 10.15)[0] == then[0], "who comes later is told all"
    assert made == [0, told[0], 0]


def test_all_who_watch_are_told() -> None:
    with serving() as (page, address):
        place_m = crowd_at(page, 1)
        watchers = [Watcher(address) for _ in range(WATCHERS)]
        for step in range(2, 5):
            for watcher in watchers:
                watcher.sees(place_m)
            place_m = crowd_at(page, step)
        for watcher in watchers:
            watcher.close()


def test_who_is_slow_skips_what_is_old_and_holds_up_nobody() -> None:
    with serving() as (page, address):
        place_m = crowd_at(page, 1)
        slow, stuck, quick = Watcher(address), Watcher(address), Watcher(address)
        for watcher in (slow, quick):
            watcher.sees(place_m)
        for step in range(2, 14):
            place_m = crowd_at(page, step, 800)
            quick.sees(place_m)
        slow.sees(place_m)
        assert slow.frames < quick.frames * 0.75
        for watcher in (slow, stuck, quick):
            watcher.close()


def test_whoever_does_not_take_what_is_told_is_left_when_the_post_stops() -> None:
    async def told() -> AsyncIterator[bytes]:
        yield b"event: changes\n\n"

    async def stop_while_sending() -> None:
        sending, never = asyncio.Event(), asyncio.Event()

        async def receive() -> Message:
            await never.wait()
            return {}

        async def send(_: Message) -> None:
            sending.set()
            await never.wait()

        scope = {"type": "http", "asgi": {"spec_version": "2.4"}}
        served = asyncio.ensure_future(Events(told())(scope, receive, send))
        await sending.wait()
        served.cancel()
        await served

    asyncio.run(stop_while_sending())


def test_nobody_is_told_of_a_change_that_is_none() -> None:
    with serving() as (page, address):
        place_m = crowd_at(page, 1)
        watcher = Watcher(address)
        watcher.sees(place_m)
        reading = threading.Thread(target=watcher.sees, args=(7.0,))
        reading.start()
        page.published(KEY, track(9.0, 7.0))
        reading.join()
        wait_for(lambda: watcher.frames == 2, "one change to be told once")
        watcher.close()
