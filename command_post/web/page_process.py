"""The page as the post has it: a process of its own, which is told and asks over one local pipe.

However many watch, and whatever they look for, costs the post nothing but to leave what it says. A
page that ends by itself is started again, and told what stands; one that hangs is ended first.
"""

from __future__ import annotations

import socket
import subprocess
import sys
import threading
import time
from collections import deque
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from queue import Empty, SimpleQueue
from typing import IO

import msgspec
import structlog

from command_post.roster import Roster
from command_post.web.board import TRAIL_POINTS, TRAIL_SPACING_M
from command_post.web.handover import MOST_RARE, Handover
from command_post.web.page import MOST_REQUESTS
from command_post.web.pipe import ALIVE, Published, Serving, Telling, read, write
from shared.bus.inbox import Inbox
from shared.messages import NodeId

TELL_S = 0.02
"""What the post has said is told so often."""

AGAIN_S = 0.5
"""A page that has ended is started again after so long."""

SIGN_S = 1.0
"""A page gives a sign of life as often at least, and the post tells it something as often."""

MISSED_SIGNS = 10
MISSED_AT_FIRST = 60
"""After so many that did not come it hangs; as it begins it may take longer."""

GRACE_S = 1.5
"""The page has so long to end when the post does."""

_log = structlog.stdlib.get_logger(__name__)


class _Place(msgspec.Struct):
    """Of an estimate, whose and where it is."""

    responder_id: NodeId
    north_m: float
    east_m: float
    down_m: float


_place = msgspec.msgpack.Decoder(_Place)
_request = msgspec.msgpack.Decoder(Published)


class Standing:
    """What was published since it was last taken, and what one has to know who comes new (pure).

    That is: what is said rarely, the newest estimate of everybody, and those on the way there that
    the page would draw a way of.
    """

    def __init__(self) -> None:
        self._new: list[Published] = []
        self._roster: Roster | None = None
        self._last_roster: Roster | None = None
        self._rare: deque[Published] = deque(maxlen=MOST_RARE)
        self._ways: dict[NodeId, deque[tuple[_Place, Published]]] = {}

    def publish(self, key_text: str, payload: bytes) -> None:
        """Take in a message that the post has published."""
        said = (key_text, payload)
        self._new.append(said)
        if key_text.endswith("/track"):
            self._lengthen(_place.decode(payload), said)
        else:
            self._rare.append(said)

    def show(self, roster: Roster) -> None:
        """Take in the newest roster."""
        self._roster = self._last_roster = roster

    def take(self) -> Telling | None:
        """Return what is new since this was last called, if anything is."""
        if not self._new and self._roster is None:
            return None
        telling = Telling(self._new, self._roster)
        self._new, self._roster = [], None
        return telling

    def whole(self) -> Telling:
        """Return all that stands; nothing of it is new afterwards."""
        self.take()
        ways = (said for way in self._ways.values() for _, said in way)
        return Telling([*self._rare, *ways], self._last_roster)

    def _lengthen(self, place: _Place, said: Published) -> None:
        """Put the newest in the last one's place, unless that is far from the one before it."""
        way = self._ways.setdefault(place.responder_id, deque(maxlen=TRAIL_POINTS))
        if len(way) > 1 and _apart_m(way[-1][0], way[-2][0]) < TRAIL_SPACING_M:
            way.pop()
        way.append((place, said))


def _apart_m(one: _Place, other: _Place) -> float:
    return max(
        abs(one.north_m - other.north_m),
        abs(one.east_m - other.east_m),
        abs(one.down_m - other.down_m),
    )


class PageProcess:
    """A guest of the post that shows itself to people; ``run`` it on a thread of its own."""

    def __init__(self, serving: Serving) -> None:
        self._serving = serving
        self._left = Handover(Standing())
        self._requests: Inbox[Published] = Inbox(MOST_REQUESTS)
        self._stop = threading.Event()
        self._process: subprocess.Popen[bytes] | None = None

    def published(self, key_text: str, payload: bytes) -> None:
        """Leave what the post has published."""
        self._left.published(key_text, payload)

    def show(self, roster: Roster) -> None:
        """Leave the newest roster."""
        self._left.show(roster)

    def take_requests(self) -> list[Published]:
        """Return what people have asked for since, as messages under their keys."""
        return self._requests.get_all()

    @property
    def waiting(self) -> int:
        """How many messages the page's process has not been told yet."""
        return self._left.waiting

    @property
    def process_id(self) -> int | None:
        """The number of the page's process, while there is one."""
        return None if self._process is None else self._process.pid

    def run(self) -> None:
        """Have a page, and tell it what there is, until ``stop``."""
        while not self._stop.is_set():
            try:
                how = self._serve_once()
            except OSError as error:
                how = str(error)
            if not self._stop.is_set():
                _log.error("the page has ended and is started again", how=how)
                self._stop.wait(AGAIN_S)

    def stop(self) -> None:
        """Have ``run`` return soon, and the page's process end."""
        self._stop.set()
        process = self._process
        if process is not None:
            with suppress(subprocess.TimeoutExpired):
                process.wait(GRACE_S)
            # Whoever is stuck in telling it something is let go by this.
            process.kill()

    def _serve_once(self) -> str:
        """Start a page, tell it what there is while it is there, and return how it ended.

        Raises ``OSError`` where no process can be started.
        """
        ours, theirs = socket.socketpair()
        signs: SimpleQueue[bool] = SimpleQueue()
        with ours:
            with theirs:
                process = self._process = subprocess.Popen(
                    [sys.executable, "-m", "command_post.web"],
                    stdin=theirs.fileno(),
                    stdout=subprocess.DEVNULL,
                    pass_fds=(self._serving.listening,),
                    start_new_session=True,
                )
            with ThreadPoolExecutor(2, thread_name_prefix="page-asks") as threads:
                heard = threads.submit(self._hear, ours, signs)
                hung = threads.submit(_end_if_stuck, process, signs)
                # A page that has ended reads no more: how it ended is told by its exit code.
                with suppress(OSError), ours.makefile("wb") as pipe:
                    self._tell(process, pipe)
                with suppress(OSError):
                    ours.shutdown(socket.SHUT_WR)
                code = process.wait()
        heard.result()
        return "it hung, and was ended" if hung.result() else f"exit code {code}"

    def _tell(self, process: subprocess.Popen[bytes], pipe: IO[bytes]) -> None:
        write(pipe, self._serving)
        with self._left.now() as standing:
            write(pipe, standing.whole())
        told_s = time.monotonic()
        while not self._stop.wait(TELL_S) and process.poll() is None:
            with self._left.now() as standing:
                telling = standing.take()
            if telling is None and time.monotonic() - told_s >= SIGN_S:
                telling = Telling()
            if telling is not None:
                write(pipe, telling)
                told_s = time.monotonic()

    def _hear(self, ours: socket.socket, signs: SimpleQueue[bool]) -> None:
        try:
            with suppress(OSError), ours.makefile("rb") as answers:
                for frame in read(answers):
                    asked = _request.decode(frame)
                    if asked == ALIVE:
                        signs.put(True)
                    else:
                        self._requests.put(asked)
        finally:
            signs.put(False)


def _end_if_stuck(process: subprocess.Popen[bytes], signs: SimpleQueue[bool]) -> bool:
    """Kill a page of which no sign comes any more, and say whether that was so.

    What is counted is how often one was waited for: a post that was stopped itself blames nobody.
    """
    missed, most = 0, MISSED_AT_FIRST
    while missed < most:
        try:
            if not signs.get(timeout=SIGN_S):
                return False
        except Empty:
            missed += 1
        else:
            missed, most = 0, MISSED_SIGNS
    process.kill()
    return True
