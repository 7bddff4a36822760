"""The gist of the recording on the disk, so that a post soon goes on without the state it had.

It is kept apart from the post's state, by the thread that records: whatever becomes of the state,
only what was recorded since has to be read.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from pathlib import Path

import structlog
import zstandard

from command_post.recorder.backlog import Item
from command_post.recorder.recording import Recorder
from command_post.resuming.beside import BEGINNING, Place, keep_beside, kept_beside, of_use
from command_post.resuming.gist import FORMAT, Gist
from shared.mcap_reader import Recording

EVERY_S = 30.0
MOST_SINCE = 20_000
"""What was recorded in so long, or is so many messages, is soon read."""

_log = structlog.stdlib.get_logger(__name__)


class GistKeeper:
    """Follows what a ``recorder`` records, and keeps the gist of all that at ``path``."""

    def __init__(
        self,
        path: Path,
        gist: Gist,
        recorder: Recorder,
        monotonic_s: Callable[[], float] = time.monotonic,
    ) -> None:
        """``gist`` is of all that was recorded until now, and is the recorder's thread's now."""
        self._path = path
        self._gist = gist
        self._recorder = recorder
        self._monotonic_s = monotonic_s
        self._next_s = monotonic_s()
        self._since = 0
        recorder.follow = self._take

    def _take(self, items: Sequence[Item], position_bytes: int) -> None:
        try:
            self._gist.read(items)
            self._since += len(items)
            if self._monotonic_s() >= self._next_s or self._since >= MOST_SINCE:
                self._next_s, self._since = self._monotonic_s() + EVERY_S, 0
                content = zstandard.compress(self._gist.packed(), 1)
                keep_beside(self._path, FORMAT, content, self._recorder, position_bytes)
        except OSError as error:
            _log.warning("the gist of the recording cannot be kept", why=str(error))
        except Exception:
            # It must not end the recording; and what it has missed, a gist does not know.
            self._recorder.follow = lambda _items, _position: None
            _log.exception("no gist of the recording is kept any more")


def gist_path(recording: Path) -> Path:
    """Return where the gist is kept that belongs to ``recording``."""
    return recording.with_name(f"{recording.name}.gist")


def gist_of(path: Path, recording: Recording) -> Gist:
    """Return the gist of all that is recorded: as it was kept at ``path``, and what came since.

    Where that is of no use it is the one kept before; without any, all is read, and that is told.
    If that cannot be read to its end, the gist is of what can.
    """
    for gist, place in of_use(path, "the gist kept", lambda each: _loaded(each, recording.path)):
        return _read(gist, recording, place)
    _log.warning("without a gist of the recording all of it is read", file=str(recording.path))
    return _read(Gist(), recording, BEGINNING)


def _read(gist: Gist, recording: Recording, place: Place) -> Gist:
    try:
        gist.read(recording.since(*place))
    except Exception:
        _log.exception("what was recorded last cannot be read", file=str(recording.path))
    return gist


def _loaded(path: Path, recording: Path) -> tuple[Gist, Place]:
    content, place = kept_beside(path, FORMAT, recording)
    return Gist.unpacked(zstandard.decompress(content)), place
