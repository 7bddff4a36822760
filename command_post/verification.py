"""What a recording holds, and whether it is all there: counts, gaps, order, hashes.

A gap is a number that is missing from a run: a journal's, whose numbers go through all that a node
keeps, and the post has asked for what did not come.
"""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Iterable
from pathlib import Path

import msgspec

from shared.codec import Refusal, parse_key
from shared.gate import JournalRun, numbering
from shared.mcap_reader import ReadReport, RecordedMessage, read_recording
from shared.received_numbers import ReceivedNumbers
from shared.units import NS_PER_S

_BLOCK_BYTES = 1 << 20


class Gaps(msgspec.Struct, frozen=True):
    """How complete a node's journal came: of its messages up to ``last_number``, so many lack."""

    role: str
    node_id: str
    run: str
    last_number: int
    missing: int


class Verification(msgspec.Struct, frozen=True, kw_only=True):
    """What there is of a recording.

    ``set_back_s`` are the times by which the post's clock was set back between one message and the
    next received; ``repeated`` messages of a journal are there twice. ``messages_sha256`` is over
    every message's times, key and bytes in order: two files of one incident that have the same are
    the same record, however they are compressed.
    """

    path: str
    file_sha256: str
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
        return self.complete and not (gaps or self.repeated or self.set_back_s)


def verify_recording(path: Path) -> Verification:
    """Read the recording at ``path`` through. Raises ``RecordingError`` if it is none."""
    recording = read_recording(path)
    account = _Account()
    account.take_all(recording)
    return account.verification(path, recording.report)


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

    def verification(self, path: Path, report: ReadReport) -> Verification:
        return Verification(
            path=str(path),
            file_sha256=_sha256(path),
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


def _sha256(path: Path) -> str:
    digest = hashlib.sha256()
    with path.open("rb") as file:
        while block := file.read(_BLOCK_BYTES):
            digest.update(block)
    return digest.hexdigest()
