"""Replay: a recording handled once more, and what comes of it compared with what came of it then.

With the settings it was recorded with, a replay makes the same estimates to the bit; with others
the report says how many differ, and where first.
"""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from msgspec import structs

from command_post.evaluation.evidence import Evidence
from command_post.incident import Incident as OwnIncident
from command_post.incident import IncidentSettings
from command_post.recorder.recorded import Incident
from shared.codec import Refusal, message_of
from shared.mcap_reader import ReadReport, RecordingError, read_recording

LONGEST_TOLD = 80
"""Of a value that differs so many characters are told."""


class Difference(NamedTuple):
    """An outgoing message that is not as it was recorded; ``None`` where there is none at all.

    ``number`` counts the outgoing messages of ``key`` from 0.
    """

    key: str
    number: int
    recorded: bytes | None
    replayed: bytes | None

    def __str__(self) -> str:
        place = f"{self.key} number {self.number}"
        if self.recorded is None or self.replayed is None:
            return f"{place}: {'not made then' if self.recorded is None else 'not made now'}"
        then, now = _fields(self.key, self.recorded), _fields(self.key, self.replayed)
        changed = [name for name in {**then, **now} if then.get(name) != now.get(name)]
        words = [
            f"{name} was {_in_short(then.get(name))}, is {_in_short(now.get(name))}"
            for name in changed
        ]
        return f"{place}: {', '.join(words) or 'the same values in other bytes'}"


@dataclass
class ReplayReport:
    """How a replay went, in outgoing messages compared byte by byte, per key and in order.

    ``missing`` were made then and not now, ``extra`` now and not then. ``unconfirmed`` are those
    whose record was cut off with the recording itself. ``reading`` says how much of the recording
    there was to replay: where messages were lost, differences are to be expected.
    """

    reading: ReadReport
    handled: int = 0
    equal: int = 0
    different: int = 0
    missing: int = 0
    extra: int = 0
    unconfirmed: int = 0
    first_difference: Difference | None = None

    @property
    def identical(self) -> bool:
        """Whether nothing came out otherwise than it was recorded."""
        return not (self.different or self.missing or self.extra)

    def __str__(self) -> str:
        counts = {
            "equal to the bit": self.equal,
            "different": self.different,
            "missing": self.missing,
            "extra": self.extra,
            "unconfirmed": self.unconfirmed,
        }
        told = ", ".join(f"{count} {what}" for what, count in counts.items() if count)
        lines = [str(self.reading), f"{self.handled} handled again; made of them: {told or 'none'}"]
        if self.first_difference is not None:
            lines.append(f"first difference: {self.first_difference}")
        return "\n".join(lines)


def _in_short(value: object) -> str:
    """Return a value as it is written; of the outlines of a region the beginning will do."""
    written = repr(value)
    return written if len(written) <= LONGEST_TOLD else f"{written[: LONGEST_TOLD - 1]}…"


class Sides(NamedTuple):
    """What was made of a recording's messages then, and what is made of them now."""

    then: Evidence
    now: Evidence


def recorded_settings(path: Path) -> IncidentSettings:
    """Return the settings a recording was made with. Raises ``RecordingError``."""
    metadata = read_recording(path).metadata
    try:
        return IncidentSettings.from_metadata(metadata)
    except ValueError as error:
        raise RecordingError(f"{path}: {error}") from error


def replay(
    path: Path,
    incident: Incident,
    sides: Sides | None = None,
    watch: Callable[[int], None] = lambda _: None,
) -> ReplayReport:
    """Let ``incident`` handle all that was received; compare what it makes with what was made.

    ``sides`` take in both. ``watch`` is told the time of each message before it is handled.

    The post's clock reads what it read then, so nothing depends on how fast this runs. An
    incident that was not finished in the recording is not finished here. Raises
    ``RecordingError`` if ``path`` cannot be read as a recording.
    """
    recording = read_recording(path)
    if isinstance(incident, OwnIncident):
        incident.attended(None, recording.put_aside())
    comparison = _Comparison()
    handled = 0
    for log_time_ns, _, key, payload, outgoing in recording:
        watch(log_time_ns)
        if outgoing:
            comparison.add(_RECORDED, key, payload)
            if sides is not None:
                sides.then.add_wire(key, payload)
            # It may have been made while nothing was heard, and nothing may be heard any more.
            step = incident.pass_time(log_time_ns)
        else:
            handled += 1
            step = incident.handle(key, payload, log_time_ns)
        if step or not outgoing:
            comparison.begin_step()
        for made in step:
            comparison.add(_REPLAYED, made.key, made.payload)
            if sides is not None:
                sides.now.add_wire(made.key, made.payload)
    if recording.report.end_ns is not None:
        comparison.begin_step()
        for made in incident.finish(recording.report.end_ns):
            comparison.add(_REPLAYED, made.key, made.payload)
    return comparison.report(recording.report, handled)


_RECORDED, _REPLAYED = 0, 1


class _Comparison:
    """Pairs the messages of each key as they come from the two sides."""

    def __init__(self) -> None:
        self._waiting: dict[str, tuple[deque[bytes], deque[bytes]]] = {}
        self._paired: Counter[str] = Counter()
        self._made_last: Counter[str] = Counter()
        self._different = 0
        self._first: Difference | None = None

    def begin_step(self) -> None:
        """What is replayed from now on comes of the next message handled."""
        self._made_last.clear()

    def add(self, side: int, key: str, payload: bytes) -> None:
        """Take the next message of ``key`` from one side; compare it if the other side has it."""
        self._made_last[key] += side == _REPLAYED
        waiting = self._waiting.setdefault(key, (deque(), deque()))
        waiting[side].append(payload)
        if all(waiting):
            recorded, replayed = (queue.popleft() for queue in waiting)
            if recorded != replayed:
                self._different += 1
                self._first = self._first or self._difference(key, recorded, replayed)
            self._paired[key] += 1

    def report(self, reading: ReadReport, handled: int) -> ReplayReport:
        """Count, now that no more will come."""
        report = ReplayReport(reading, handled, different=self._different)
        report.equal = self._paired.total() - self._different
        for key, (recorded, replayed) in self._waiting.items():
            cut_off = 0 if reading.finished else min(len(replayed), self._made_last[key])
            report.unconfirmed += cut_off
            report.missing += len(recorded)
            report.extra += len(replayed) - cut_off
            if recorded or len(replayed) > cut_off:
                sides = ([*queue, None][0] for queue in (recorded, replayed))
                self._first = self._first or self._difference(key, *sides)
        report.first_difference = self._first
        return report

    def _difference(self, key: str, recorded: bytes | None, replayed: bytes | None) -> Difference:
        return Difference(key, self._paired[key], recorded, replayed)


def _fields(key_text: str, payload: bytes) -> dict[str, Any]:
    """Return the fields of a message by name; of anything else, its bytes."""
    message = message_of(key_text, payload)
    if isinstance(message, Refusal):
        return {"bytes": payload}
    return structs.asdict(message)
