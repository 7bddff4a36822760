"""What a recording holds, and whether it is all there: counts, gaps, order, hashes.

A gap is a number that is missing from a run: a journal's, whose numbers go through all that a node
keeps, and the post has asked for what did not come.
"""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path

import msgspec

from shared.codec import Refusal, parse_key
from shared.gate import JournalRun, numbering
from shared.mcap_reader import RecordedMessage, Recording, read_recording
from shared.received_numbers import ReceivedNumbers
from shared.recording_parts import Part, sha256_of
from shared.units import NS_PER_S


class Gaps(msgspec.Struct, frozen=True):
    """How complete a node's journal came: of its messages up to ``last_number``, so many lack."""

    role: str
    node_id: str
    run: str
    last_number: int
    missing: int


class File(msgspec.Struct, frozen=True):
    """A file of a recording; ``follows`` says whether it follows the one before it to the byte."""

    name: str
    size_bytes: int
    sha256: str
    follows: bool


class Verification(msgspec.Struct, frozen=True, kw_only=True):
    """What there is of a recording.

    ``set_back_s`` are the times by which the post's clock was set back between one message and the
    next received; ``repeated`` messages of a journal are there twice. ``messages_sha256`` is over
    every message's times, key and bytes in order: two files of one incident that have the same are
    the same record, however they are compressed.
    """

    path: str
    files: list[File]
    messages_sha256: str
    finished: bool
    complete: bool
    reading: str
    first_ns: int | None
    last_ns: int | None
    received: dict[str, int]
    made: dict[str, int]
    unreadable_keys: int
    journals: list[Gaps]
    repeated: int
    set_back_s: list[float]

    @property
    def whole(self) -> bool:
        """Whether nothing is missing, repeated or out of order."""
        gaps = any(each.missing for each in self.journals)
        apart = not all(each.follows for each in self.files)
        return self.complete and not (gaps or apart or self.repeated or self.set_back_s)


def verify_recording(path: Path) -> Verification:
    """Read the recording at ``path`` through. Raises ``RecordingError`` if it is none."""
    recording = read_recording(path)
    account = _Account()
    account.take_all(recording)
    return account.verification(recording)


class _Account:
    def __init__(self) -> None:
        self._received: Counter[str] = Counter()
        self._made: Counter[str] = Counter()
        self._unreadable_keys = 0
        self._journals: dict[JournalRun, ReceivedNumbers] = {}
        self._repeated = 0
        self._set_back_s: list[float] = []
        self._first_ns: int | None = None
        self._last_ns: int | None = None
        self._digest = hashlib.sha256()

    def take_all(self, messages: Iterable[RecordedMessage]) -> None:
        for message in messages:
            self._take(message)

    def _take(self, message: RecordedMessage) -> None:
        log_time_ns, publish_time_ns, key_text, payload, outgoing = message
        self._digest.update(f"{log_time_ns} {publish_time_ns} {outgoing:d} {key_text}\n".encode())
        self._digest.update(hashlib.sha256(payload).digest())
        self._follow_clock(log_time_ns)
        key = parse_key(key_text)
        if isinstance(key, Refusal):
            self._unreadable_keys += 1
            return
        (self._made if outgoing else self._received)[key.topic] += 1
        if not outgoing:
            self._number(key_text, payload)

    def _follow_clock(self, now_ns: int) -> None:
        if self._first_ns is None:
            self._first_ns = now_ns
        if self._last_ns is not None and now_ns < self._last_ns:
            self._set_back_s.append((self._last_ns - now_ns) / NS_PER_S)
        self._last_ns = now_ns

    def _number(self, key_text: str, payload: bytes) -> None:
        numbered = numbering(key_text, payload)
        if numbered is not None:
            run, number = numbered
            self._repeated += not self._journals.setdefault(run, ReceivedNumbers()).take(number)

    def verification(self, recording: Recording) -> Verification:
        """Return what all that was taken comes to."""
        report = recording.report
        return Verification(
            path=str(recording.path),
            files=_files(recording.parts),
            messages_sha256=self._digest.hexdigest(),
            finished=report.finished,
            complete=report.complete,
            reading=str(report),
            first_ns=self._first_ns,
            last_ns=self._last_ns,
            received=dict(sorted(self._received.items())),
            made=dict(sorted(self._made.items())),
            unreadable_keys=self._unreadable_keys,
            journals=[
                Gaps(run.role, run.node_id, run.run.hex(), numbers.highest, numbers.missing)
                for run, numbers in sorted(self._journals.items())
            ],
            repeated=self._repeated,
            set_back_s=self._set_back_s,
        )


def _files(parts: Sequence[Part]) -> list[File]:
    files: list[File] = []
    for path, _, link in parts:
        follows = link is None
        if link is not None and files:
            before = files[-1]
            told = (link.previous, link.previous_bytes, link.previous_sha256)
            follows = (before.name, before.size_bytes, before.sha256) == told
        files.append(File(path.name, path.stat().st_size, sha256_of(path), follows))
    return files
