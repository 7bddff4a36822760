"""The page's own process: the post starts it, tells it what there is, and hears what is asked.

``python -m command_post.web`` has a local socket as its standard input: it reads there, in frames
of ``command_post.web.pipe``, what there is, and writes there what people ask for. It ends once the
post has gone, however that went: the other end closes.

Its sign of life goes through each of its threads: one reads, the next makes something of it, the
third serves, the last writes. If any is stuck, none comes, and the post starts another page.
"""

from __future__ import annotations

import signal
import socket
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import IO

import msgspec
import structlog

from command_post.web.app import Site, make_app
from command_post.web.handover import MOST_TRACKS
from command_post.web.page import Page
from command_post.web.people import Door
from command_post.web.pipe import Serving, Telling, read, write
from command_post.web.serving import InTurn, serving_on
from shared.process import configure_logging, leave

ASKED_S = 0.2
"""Whoever passes on what is asked looks so often whether it is to end."""

EXIT_UNUSABLE = 2
"""What it was given to serve with cannot be used."""

_telling = msgspec.msgpack.Decoder(Telling)
_log = structlog.stdlib.get_logger(__name__)


def main() -> int:
    """Serve the page until standard input ends; return the exit code."""
    # Ctrl-C goes to all processes of a terminal; the post says when this one is to end.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    configure_logging("warning")
    try:
        with socket.socket(fileno=sys.stdin.fileno()) as post:
            _serve(post)
    except ValueError as error:
        _log.error("the page cannot be served", why=str(error))
        return EXIT_UNUSABLE
    return 0


def _serve(post: socket.socket) -> None:
    with post.makefile("rb") as said, post.makefile("wb") as answers:
        frames = read(said)
        first = next(frames, None)
        if first is None:
            return
        serving = msgspec.msgpack.decode(first, type=Serving)
        if serving.keys is not None:
            serving.keys.check()
        page = Page(serving.incident)
        site = _site(serving, page)
        listening = socket.socket(fileno=serving.listening)
        told = threading.Event()
        with (
            serving_on(listening, lambda ends: make_app(site, ends), serving.keys) as in_turn,
            _at_it(page, answers, told, in_turn),
        ):
            for frame in frames:
                _take_in(page, _telling.decode(frame))
                told.set()


def _take_in(page: Page, new: Telling) -> None:
    for key_text, payload in new.published:
        page.published(key_text, payload)
        if page.waiting > MOST_TRACKS // 2:
            page.take_in()
    if new.roster is not None:
        page.show(new.roster)


def _site(serving: Serving, page: Page) -> Site:
    return Site(
        serving.incident, serving.post_id, page,
        None if serving.people is None else Door(serving.people, time.monotonic()),
        secure=serving.keys is not None, hosts=frozenset(serving.hosts), plan=serving.plan,
        teams=serving.teams,
    )  # fmt: skip


@contextmanager
def _at_it(
    page: Page, answers: IO[bytes], told: threading.Event, in_turn: InTurn
) -> Iterator[None]:
    """Keep the page up with the post, and pass on to it what people ask for.

    Who was ``told`` something since gives a sign of life, and who serves passes it on.
    """
    stop = threading.Event()

    def kept_up() -> None:
        if told.is_set():
            told.clear()
            in_turn(page.say_alive)

    def pass_on() -> None:
        while not stop.is_set():
            for asked in page.take_requests(ASKED_S):
                with suppress(BrokenPipeError):
                    write(answers, asked)

    threads = [
        threading.Thread(target=page.keep_up, args=(stop, kept_up), name="page-keeper"),
        threading.Thread(target=pass_on, name="page-asks"),
    ]
    for thread in threads:
        thread.start()
    try:
        yield
    finally:
        stop.set()
        for thread in threads:
            thread.join()


if __name__ == "__main__":
    leave(main())
