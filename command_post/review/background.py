"""Compares in a process of its own, one wish at a time, so that the page stays as quick."""

from __future__ import annotations

import multiprocessing
import threading
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnProcess
from typing import NamedTuple, Self

from command_post.review.wishes import Compared, Sources, Wish
from shared.config import ConfigError
from shared.mcap_reader import RecordingError

LEAST_NEWS = 0.01
"""Progress is told when it is so much further."""

_PATIENCE_S = 5.0


class Progress(NamedTuple):
    """How far a wish is: ``share`` of 1; ``failed`` says why nothing comes of it."""

    wish: Wish | None
    share: float
    failed: str | None
    is_done: bool


class Background:
    """Fulfils wishes. Any thread may ask."""

    def __init__(self, sources: Sources, begin_ns: int, end_ns: int) -> None:
        self.sources = sources
        self._span_ns = (begin_ns, end_ns)
        self._lock = threading.Lock()
        self._process: SpawnProcess | None = None
        self._progress = Progress(None, 0.0, None, is_done=False)
        self._result: Compared | None = None

    def begin(self, wish: Wish) -> None:
        """Begin with a wish; one that is not fulfilled yet is given up for it."""
        context = multiprocessing.get_context("spawn")
        ours, theirs = context.Pipe(duplex=False)
        with self._lock:
            self._give_up()
            arguments = (theirs, self.sources, wish, self._span_ns)
            self._process = context.Process(target=_work, args=arguments, daemon=True)
            self._progress, self._result = Progress(wish, 0.0, None, is_done=False), None
            self._process.start()
        theirs.close()
        threading.Thread(target=self._hear, args=(ours, wish), name="comparison").start()

    @property
    def progress(self) -> Progress:
        """How far it is."""
        return self._progress

    @property
    def result(self) -> Compared | None:
        """What came of the newest wish, once it is done."""
        return self._result

    def __enter__(self) -> Self:
        """Return it, idle."""
        return self

    def __exit__(self, *_: object) -> None:
        """Give up what is not done."""
        with self._lock:
            self._give_up()

    def _give_up(self) -> None:
        if self._process is not None:
            self._process.terminate()
            self._process.join(_PATIENCE_S)
            self._process = None

    def _hear(self, connection: Connection, wish: Wish) -> None:
        """Take in what the process says of its wish, until it has said all."""
        told: float | str | Compared = 0.0
        with connection:
            while isinstance(told, float):
                self._take(wish, Progress(wish, told, None, is_done=False))
                try:
                    told = connection.recv()
                except EOFError:
                    told = "it was broken off"
        if isinstance(told, str):
            self._take(wish, Progress(wish, 1.0, told, is_done=True))
        else:
            self._take(wish, Progress(wish, 1.0, None, is_done=True), told)

    def _take(self, wish: Wish, progress: Progress, result: Compared | None = None) -> None:
        with self._lock:
            if self._progress.wish is wish:
                self._progress, self._result = progress, result


def _work(connection: Connection, sources: Sources, wish: Wish, span_ns: tuple[int, int]) -> None:
    """Fulfil a wish; say how far it is, at last what came of it, or why nothing did."""
    # Only who compares loads the fusion: the page is to be there at once.
    from command_post.review.comparison import compare  # noqa: PLC0415

    told = 0.0
    begin_ns, end_ns = span_ns

    def watch(log_time_ns: int) -> None:
        nonlocal told
        share = min((log_time_ns - begin_ns) / max(end_ns - begin_ns, 1), 1.0)
        if share - told >= LEAST_NEWS:
            told = share
            connection.send(share)

    try:
        connection.send(compare(sources, wish, watch))
    except (RecordingError, ConfigError) as error:
        connection.send(str(error))
