"""All that a post keeps beside its recording, and how it goes on from that."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import Event, Thread

import structlog

from command_post.incident import Incident, IncidentSettings
from command_post.recorder.recording import Recorder
from command_post.resuming.beside import before_path
from command_post.resuming.checkpoint import Checkpoints, checkpoint_path, kept_states
from command_post.resuming.gist import Gist
from command_post.resuming.gist_keeper import GistKeeper, gist_of, gist_path
from command_post.resuming.handling import Ends, Handling, handling_path
from command_post.resuming.taking_up import TakenUp, TakingUp
from command_post.resuming.watcher import Watcher, end_at_once
from shared.mcap_reader import read_recording

_log = structlog.stdlib.get_logger(__name__)


class Resumption:
    """The state, the gist, and what is handled, of what a ``recorder`` records at ``record``."""

    def __init__(self, record: Path, recorder: Recorder, settings: IncidentSettings) -> None:
        self._recorder = recorder
        self._settings = settings
        self._unfinished = recorder.unfinished
        self._state, self._gist = checkpoint_path(record), gist_path(record)
        self._states = (self._state, before_path(self._state))
        self._handled = handling_path(record)
        self._handling = self._opened()
        self._ends = Ends() if self._handling is None else self._handling.ends
        self.checkpoints = Checkpoints(self._state, recorder)

    def begin(self) -> Incident:
        """Return an incident that has heard nothing yet."""
        return self._attended(Incident(self._settings, keeps_all=False))

    def take_up(self, go_on: Callable[[TakingUp], TakenUp]) -> TakenUp | None:
        """Have a post ``go_on`` with an unfinished recording, and keep the gist from now on.

        Returns what it goes on with; ``None`` if it begins one.
        """
        taken = None
        if self._unfinished is None:
            GistKeeper(self._gist, Gist(), self._recorder)
        else:
            taken = self._taken_up(self._unfinished, go_on)
        if self._handling is not None:
            self._handling.is_live = True
        return taken

    def _taken_up(self, unfinished: Path, go_on: Callable[[TakingUp], TakenUp]) -> TakenUp:
        recording = read_recording(unfinished)
        gist = gist_of(self._gist, recording)
        GistKeeper(self._gist, gist, self._recorder)
        states = kept_states(self._state, unfinished, self._settings)
        taking_up = TakingUp(recording, gist, states, self.begin, self._attended, self._ends)
        taken = go_on(taking_up)
        if taken.begun_from != "all":
            # A state from before would not know of that.
            for path in self._states:
                path.unlink(missing_ok=True)
        return taken

    @contextmanager
    def watched(self, end: Callable[[], object] = end_at_once) -> Iterator[None]:
        """Have what is handled within watched: what sticks is told, and ended by ``end``."""
        stop = Event()
        if self._handling is not None:
            Thread(
                target=Watcher(self._handling, end).run, args=(stop,), name="watcher", daemon=True
            ).start()
        try:
            yield
        finally:
            stop.set()

    @property
    def files(self) -> tuple[Path, ...]:
        """What is of no use once the recording is whole."""
        return (*self._states, self._gist, before_path(self._gist), self._handled)

    def _attended(self, incident: Incident) -> Incident:
        incident.attended(self._handling, self._ends.put_aside)
        return incident

    def _opened(self) -> Handling | None:
        try:
            return Handling(self._handled, goes_on=self._unfinished is not None)
        except OSError as error:
            _log.warning("what is handled cannot be noted", why=str(error))
            return None
