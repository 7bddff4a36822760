"""The page's own process: the post tells and hears it, waits for none of it, and leaves none."""

from __future__ import annotations

import errno
import io
import os
import signal
import socket
import subprocess
import sys
import threading
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path
from queue import SimpleQueue
from typing import TypeAlias

import msgspec
import pytest

from command_post.listening import Address
from command_post.roster import Roster
from command_post.web import page as page_module
from command_post.web import page_process
from command_post.web.__main__ import _at_it, _serve
from command_post.web.board import TRAIL_POINTS, TRAIL_SPACING_M, Board
from command_post.web.handover import MOST_RARE
from command_post.web.page import Page
from command_post.web.page_process import PageProcess, Standing
from command_post.web.pipe import ALIVE, Published, Serving, Telling, read, write
from command_post.web.server import page_served
from command_post.web.serving import ServerKeys
from shared.bus.inbox import Inbox
from shared.codec import Refusal, decode, parse_key
from shared.messages import OrderRequest
from shared.units import NS_PER_S
from tests.waiting import DEADLINE_S, wait_for
from tests.web.test_board import KEY, track
from tests.web.test_handover import ALERT_KEY, alert

Turn: TypeAlias = Callable[[], None]

HOST = "127.0.0.1"
LEFT_BEHIND = """
import sys
from command_post.listening import Address
from command_post.web.server import page_served
from shared.process import configure_logging
configure_logging()
with page_served(Address("127.0.0.1", 0), "test", "post", None, None) as page:
    while page.process_id is None: pass
    print(page.process_id, flush=True)
    sys.stdin.read()
"""


def is_there(process_id: int) -> bool:
    """Say whether a process still runs."""
    try:
        state = Path(f"/proc/{process_id}/stat").read_text().rpartition(") ")[2]
    except OSError:
        return False
    return not state.startswith("Z")


@contextmanager
def shown() -> Iterator[tuple[PageProcess, int]]:
    """Serve a page, and give it and its port."""
    with socket.create_server((HOST, 0)) as free:
        address = Address(*free.getsockname())
    with page_served(address, "test", "post", None, None) as page:
        assert page is not None
        yield page, address.port


class Visitor:
    """Somebody who looks at a page over HTTP, and asks for something."""

    def __init__(self, port: int) -> None:
        self._url = f"http://{HOST}:{port}/api/v1/"

    def sees(self) -> dict[str, object]:
        """Return all there is."""
        with urllib.request.urlopen(self._url + "state", timeout=DEADLINE_S) as answer:  # noqa: S310
            told: dict[str, object] = msgspec.json.decode(answer.read())
        return told

    def orders(self) -> None:
        """Have everybody come out."""
        with urllib.request.urlopen(self._url + "me", timeout=DEADLINE_S) as answer:  # noqa: S310
            token = msgspec.json.decode(answer.read())["token"]
        asked = urllib.request.Request(  # noqa: S310
            self._url + "orders",
            b'{"kind": "evacuate"}',
            {"X-Clew-Token": token, "Content-Type": "application/json"},
        )
        with urllib.request.urlopen(asked, timeout=DEADLINE_S) as answer:  # noqa: S310
            assert answer.status == 202


class Heard(SimpleQueue[bool]):
    """Signs of life, which are noted elsewhere as well."""

    def __init__(self, noted: Inbox[bool]) -> None:
        self._noted = noted

    def put(self, item: bool, block: bool = True, timeout: float | None = None) -> None:
        """Take in a sign."""
        super().put(item, block, timeout)
        self._noted.put(item)


def test_the_page_is_told_and_heard_and_comes_again(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(page_process, "AGAIN_S", 0.0)
    with shown() as (page, port):
        visitor = Visitor(port)
        for step in range(4):
            page.published(KEY, track(float(step), 2.0 * step))
        page.published(ALERT_KEY, alert(7))
        page.show(Roster(5 * NS_PER_S, (), ()))
        wait_for(lambda: "roster" in visitor.sees(), "the page to be told")
        before = visitor.sees()
        visitor.orders()
        asked: list[tuple[str, bytes]] = []

        def heard() -> bool:
            asked.extend(page.take_requests())
            return bool(asked)

        wait_for(heard, "the post to hear")
        ((key_text, payload),) = asked
        key = parse_key(key_text)
        assert not isinstance(key, Refusal)
        assert isinstance(decode(key, payload), OrderRequest)
        first = page.process_id
        assert first is not None
        os.kill(first, signal.SIGKILL)
        wait_for(lambda: page.process_id != first, "another process")
        wait_for(lambda: "roster" in visitor.sees(), "that to be told as well")
        after = visitor.sees()
        for what in ("tracks", "trails", "alerts", "roster"):
            assert after[what] == before[what], what
        last = page.process_id
    assert last is not None
    assert not is_there(last)
    assert "is started again" in capsys.readouterr().out


def test_a_page_that_cannot_be_started_is_tried_again(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    tries: list[object] = []

    def refused(*_: object, **__: object) -> None:
        tries.append(None)
        raise OSError(errno.EAGAIN, "no more processes")

    monkeypatch.setattr(page_process, "AGAIN_S", 0.0)
    monkeypatch.setattr(subprocess, "Popen", refused)
    with shown():
        wait_for(lambda: len(tries) > 1, "another try")
    assert "no more processes" in capsys.readouterr().out


def test_a_page_that_is_stuck_holds_up_nobody_and_is_replaced(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(page_process, "AGAIN_S", 0.0)
    monkeypatch.setattr(page_process, "SIGN_S", 0.1)
    monkeypatch.setattr(page_process, "MISSED_AT_FIRST", 10_000)
    signs = Inbox[bool](1)
    monkeypatch.setattr(page_process, "SimpleQueue", lambda: Heard(signs))
    with shown() as (page, port):
        visitor = Visitor(port)
        page.show(Roster(5 * NS_PER_S, (), ()))
        wait_for(lambda: len(signs), "a sign of life")
        first = page.process_id
        assert first is not None
        os.kill(first, signal.SIGSTOP)
        for number in range(20_000):
            page.published(KEY, track(float(number), 1.0))
        wait_for(lambda: page.process_id != first, "the page to be given up")
        monkeypatch.setattr(page_process, "MISSED_SIGNS", 10_000)
        wait_for(lambda: "roster" in visitor.sees(), "another to be told")
        assert not is_there(first)
    assert "it hung, and was ended" in capsys.readouterr().out


def test_a_page_that_gives_signs_of_life_is_left_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(page_process, "SIGN_S", 0.0)
    with subprocess.Popen(["sleep", "60"]) as process:
        signs: SimpleQueue[bool] = SimpleQueue()
        for _ in range(2 * page_process.MISSED_AT_FIRST):
            signs.put(True)
        signs.put(False)
        assert not page_process._end_if_stuck(process, signs)
        assert process.poll() is None
        assert page_process._end_if_stuck(process, signs), "none comes any more"
        assert process.wait(DEADLINE_S) == -signal.SIGKILL


def test_a_sign_of_life_goes_through_who_was_told_and_who_serves(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(page_module, "KEEP_UP_S", 0.001)
    page, told, answers, turns = Page("test"), threading.Event(), io.BytesIO(), Inbox[Turn](9)
    with _at_it(page, answers, told, turns.put):
        told.set()
        turn = turns.get(DEADLINE_S)
        assert turn is not None
        assert turns.get(0.02) is None, "nothing was told since"
        assert answers.getvalue() == b""
        turn()
        wait_for(answers.getvalue, "the sign")
    (frame,) = read(io.BytesIO(answers.getvalue()))
    assert msgspec.msgpack.decode(frame, type=Published) == ALIVE


def test_keys_that_cannot_be_used_are_told_of_plainly(tmp_path: Path) -> None:
    files = [tmp_path / name for name in ("certificate.pem", "private.key")]
    keys = ServerKeys(*map(str, files))
    post, page = socket.socketpair()
    with post, page, post.makefile("wb") as pipe:
        write(pipe, Serving("test", "post", post.fileno(), keys=keys))
        with pytest.raises(ValueError, match=r"cannot be encrypted.*No such file.*copy the bundle"):
            _serve(page)
    for file in files:
        file.write_text("no key")
    with pytest.raises(ValueError, match=r"certificate\.pem.*cannot be encrypted.*copy the bundle"):
        keys.check()


def test_the_page_goes_with_a_post_that_is_killed() -> None:
    command = [sys.executable, "-c", LEFT_BEHIND]
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
    ) as post:
        assert post.stdout is not None
        process_id = int(post.stdout.readline())
        assert is_there(process_id)
        post.kill()
        wait_for(lambda: not is_there(process_id), "the page to go too")


def test_what_stands_draws_the_same_ways_and_is_bounded() -> None:
    standing, board = Standing(), Board()
    for number in range(20 * TRAIL_POINTS):
        said = (KEY, track(0.1 * number, 0.2 * number))
        standing.publish(*said)
        board.publish(*said)
    for number in range(MOST_RARE + 3):
        standing.publish(ALERT_KEY, alert(number))
    standing.show(Roster(5, (), ()))
    told, again = standing.whole(), Board()
    assert len(told.published) == MOST_RARE + TRAIL_POINTS
    assert told.roster == Roster(5, (), ())
    for said in told.published:
        again.publish(*said)
    (before,), (after,) = board.since(0).tracks, again.since(0).tracks
    assert after == before, "the newest of all"
    trail = again.since(0).trails or {}
    way_m = [north_m for north_m, _, _ in trail["r1"]]
    gaps_m = [b - a for a, b in pairwise(way_m)]
    assert way_m[-1] - way_m[0] > 0.9 * TRAIL_POINTS * TRAIL_SPACING_M
    assert min(gaps_m) >= TRAIL_SPACING_M


def test_what_is_new_is_told_once() -> None:
    standing = Standing()
    assert standing.take() is None
    standing.publish(KEY, track(0.0, 1.0))
    standing.show(Roster(5, (), ()))
    assert standing.take() == Telling([(KEY, track(0.0, 1.0))], Roster(5, (), ()))
    assert standing.take() is None
    standing.publish(KEY, track(0.1, 1.0))
    standing.whole()
    assert standing.take() is None, "who was told all was told that"


def test_what_is_broken_off_is_no_frame() -> None:
    pipe = io.BytesIO()
    write(pipe, ("key", b"1"))
    write(pipe, ("key", b"2"))
    for length in range(len(pipe.getvalue()) + 1):
        frames = list(read(io.BytesIO(pipe.getvalue()[:length])))
        assert len(frames) == length * 2 // len(pipe.getvalue())
