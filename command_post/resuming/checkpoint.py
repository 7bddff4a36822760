"""The post's state on the disk now and then, so that it is soon back after a kill.

Everything can be made again from the recording; that takes as long as it took to make it. So the
incident as it is at some place of the recording is kept beside it, and only what follows is handled
again. It is a convenience: what is damaged, of other software or of another recording is passed
over for the one kept before it, and if that is of no use either all is handled again.
"""

from __future__ import annotations

import hashlib
import io
import pickle
import time
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import structlog
import zstandard

import command_post
import shared
from command_post.incident import Incident, IncidentSettings
from command_post.recorder.recording import Recorder
from command_post.resuming.beside import Place, keep_beside, kept_beside, of_use
from shared.bus.interface import Received
from shared.gate import Remembered

WORTH_S = 1.0
"""So much work is not to be done again after a kill."""

SHARE = 0.02
"""Of the time at most so much goes into keeping it: all that comes meanwhile has to wait."""

MOST_HALT_S = 1.0
"""All have to wait while the state is being kept: a longer wait is rarer by as much again."""

ASIDE = frozenset({
    "commands", "doctor", "evaluation", "exports", "gateways", "proof", "review", "simulation",
    "web",
})  # fmt: skip
"""Packages that nothing of a state is of, nor made by: a page may change, the state still fits."""

_OWN = frozenset({"command_post", "shared"})
_OTHERS = frozenset({"collections", "msgspec", "copyreg"})
_BUILTINS = frozenset({"set", "frozenset", "bytearray", "complex", "range", "slice"})
_ARRAYS = frozenset({"ndarray", "dtype", "scalar", "_reconstruct", "_frombuffer"})

_log = structlog.stdlib.get_logger(__name__)


class State(NamedTuple):
    """What a post has made of what it has handled.

    ``exercise`` is what set its clock, if anything did; ``last_ns`` is as of when it handled
    anything last.
    """

    incident: Incident
    remembered: Remembered
    exercise: Received | None
    last_ns: int


class Kept(NamedTuple):
    """A state, and how far into the recording it is one of."""

    state: State
    place: Place


class Checkpoints:
    """Keeps a post's state at ``path`` whenever that is worth it."""

    def __init__(self, path: Path, recorder: Recorder) -> None:
        self._path = path
        self._recorder = recorder
        # Of the software that runs, whatever takes its place on the disk meanwhile.
        self._software = software()
        self._worked_s = 0.0
        self._last_took_s = 0.0
        self._kept_s = time.monotonic()
        self._writing = False

    def work(self, seconds: float) -> None:
        """Note that handling has taken so long."""
        self._worked_s += seconds

    @property
    def is_due(self) -> bool:
        """Whether it is worth keeping the state now."""
        is_long_ago = time.monotonic() - self._kept_s >= self._pause_s
        is_worth_it = self._worked_s >= WORTH_S and is_long_ago
        return is_worth_it and not self._writing and self._recorder.has_room

    @property
    def _pause_s(self) -> float:
        """How long it is not kept again."""
        return self._last_took_s / SHARE * max(self._last_took_s / MOST_HALT_S, 1.0)

    def keep(self, state: State) -> None:
        """Keep ``state``, of all that the recorder has been given until now, once that is safe."""
        # By the thread's own time: how busy the machine was for once says nothing.
        began_s = time.thread_time()
        pickled = pickle.dumps(state, protocol=5)
        self._last_took_s = time.thread_time() - began_s
        if self._last_took_s > MOST_HALT_S:
            _log.warning(
                "the post's state is big, and kept rarely: after a kill all since is done again",
                took_s=round(self._last_took_s, 1), again_in_s=round(self._pause_s),
            )  # fmt: skip
        self._worked_s = 0.0
        self._kept_s = time.monotonic()
        self._writing = self._recorder.when_safe(lambda position: self._write(pickled, position))

    def _write(self, pickled: bytes, position_bytes: int) -> None:
        """Write it, on the recorder's thread."""
        try:
            compressed = zstandard.compress(pickled, 1)
            keep_beside(self._path, self._software, compressed, self._recorder, position_bytes)
        except OSError as error:
            _log.warning("the post's state cannot be kept", why=str(error))
        finally:
            self._writing = False


def checkpoint_path(recording: Path) -> Path:
    """Return where the state is kept that belongs to ``recording``."""
    return recording.with_name(f"{recording.name}.checkpoint")


def kept_states(path: Path, recording: Path, settings: IncidentSettings) -> Iterator[Kept]:
    """Return what is kept at ``path`` of the unfinished ``recording``, then what was before that.

    What is of no use is told of instead.
    """
    return of_use(
        path, "the state kept of the incident", lambda each: _loaded(each, recording, settings)
    )


def _loaded(path: Path, recording: Path, settings: IncidentSettings) -> Kept:
    content, place = kept_beside(path, software(), recording)
    state = _Unpickler(io.BytesIO(zstandard.decompress(content))).load()
    if not isinstance(state, State):
        raise ValueError("it is no state")
    if state.incident.settings != settings:
        raise ValueError("it is of other settings")
    return Kept(state, place)


class _Unpickler(pickle.Unpickler):
    """Makes nothing but what a state consists of."""

    def find_class(self, module: str, name: str) -> Any:
        """Return the class or function of that name; ``UnpicklingError`` if no state has it."""
        package = module.partition(".")[0]
        allowed = (
            package in _OWN | _OTHERS
            or (package == "builtins" and name in _BUILTINS)
            or (package == "numpy" and (name in _ARRAYS or module.startswith("numpy.random.")))
        )
        found = super().find_class(module, name) if allowed else None
        if allowed and (package not in _OWN or isinstance(found, type)):
            return found
        raise pickle.UnpicklingError(f"{module}.{name} is nothing that a state has")


@cache
def software() -> str:
    """Return what tells this software from any other: a digest of what makes a state."""
    digest = hashlib.sha256()
    for package in (command_post, shared):
        folder = Path(package.__path__[0])
        for path in sorted(folder.rglob("*.py")):
            if path.relative_to(folder).parts[0] not in ASIDE:
                digest.update(path.read_bytes())
    return digest.hexdigest()
