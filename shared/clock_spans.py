"""Which part of a node's journal was dated by a clock that was off by how much.

Each process reads the machine's clock once, and goes by that: what another one wrote into the same
journal may be dated by a clock that was set otherwise. So each process notes, in a file beside the
journal, from which number on it dates, by what reading, and what it finds out of its offset. While
the machine has not been started anew, one reading tells of the other to the nanosecond; after that
the node's own findings count, or, if there were none, what its clock is off by now.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import msgspec
import structlog

from shared.clock_sync import MOST_DRIFT, ClockOffset
from shared.files import replace_atomically
from shared.messages import ClockOffsetNs, ClockSpan, MessageNumber, RunId, TimeNs
from shared.units import NS_PER_S

BOOT_ID = Path("/proc/sys/kernel/random/boot_id")

MOST_SPANS = 32
SAME_BASE_NS = 1_000_000
"""Readings of a clock that nobody has set differ by less."""

SET_DOUBT_NS = 60 * NS_PER_S
"""How surely a machine that was started anew has the time it had before."""

NOTED_AGAIN_NS = 60 * NS_PER_S
"""What is found out meanwhile is noted this often."""

_log = structlog.stdlib.get_logger(__name__)


class DatedSpan(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What a process dated from number ``first_number`` on, begun when its clock read ``begun_ns``.

    The clock read ``base_ns`` when the machine, in its start ``boot``, was started; the post's was
    ahead of it by ``offset_ns``, as far as the process found out.
    """

    first_number: MessageNumber
    begun_ns: TimeNs
    boot: str
    base_ns: int
    offset_ns: ClockOffsetNs | None = None
    uncertainty_ns: TimeNs | None = None


class SpanNotes(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The spans of the journal with that ``run``, oldest first; the last one goes on."""

    run: RunId
    spans: tuple[DatedSpan, ...]


def with_span(notes: SpanNotes | None, run: bytes, span: DatedSpan) -> SpanNotes:
    """Return ``notes`` with another ``span`` of the journal with that ``run``.

    A span without a message is left out, and so is the seam between two that were dated alike.
    """
    before = () if notes is None or notes.run != run.hex() else notes.spans
    before = tuple(each for each in before if each.first_number < span.first_number)
    if before and _dated_alike(before[-1], span):
        span = msgspec.structs.replace(before[-1], base_ns=span.base_ns)
        before = before[:-1]
    return SpanNotes(run=run.hex(), spans=(*before, span)[-MOST_SPANS:])


def stated_spans(
    spans: Sequence[DatedSpan], offset: ClockOffset, now_ns: int
) -> tuple[ClockSpan, ...]:
    """Return what to state of ``spans`` when the last one's clock, at ``now_ns``, is off so."""
    *earlier, last = spans
    stated = [_stated(each, last, offset, now_ns) for each in earlier]
    return (*stated, _clock_span(last, offset.offset_ns, offset.uncertainty_ns))


class ClockSpans:
    """The notes of one process, in the file at ``path``.

    A disk that does not take them is told of once: then the spans are of this process alone.
    """

    def __init__(self, path: Path, run: bytes, span: DatedSpan) -> None:
        self._path = path
        self._notes = with_span(_read(path), run, span)
        self._noted_ns: int | None = None
        self._told = False
        self._note()

    def stated(self, run: bytes, offset: ClockOffset, now_ns: int) -> tuple[ClockSpan, ...]:
        """Return what to state of the journal with that ``run``, and note ``offset``."""
        if run.hex() != self._notes.run:
            return ()
        if self._noted_ns is None or now_ns - self._noted_ns > NOTED_AGAIN_NS:
            self._noted_ns = now_ns
            last = msgspec.structs.replace(
                self._notes.spans[-1],
                offset_ns=offset.offset_ns,
                uncertainty_ns=offset.uncertainty_ns,
            )
            self._notes = msgspec.structs.replace(
                self._notes, spans=(*self._notes.spans[:-1], last)
            )
            self._note()
        spans = self._notes.spans
        return stated_spans(spans, offset, now_ns) if len(spans) > 1 else ()

    def _note(self) -> None:
        try:
            with replace_atomically(self._path) as file:
                file.write(msgspec.json.encode(self._notes))
        except OSError as error:
            if not self._told:
                self._told = True
                _log.warning("which clock dated what is not noted", why=str(error))


def boot_id() -> str:
    """Return what names this start of the machine; nothing where it does not tell."""
    try:
        return BOOT_ID.read_text().strip()
    except OSError:
        return ""


def _read(path: Path) -> SpanNotes | None:
    try:
        return msgspec.json.decode(path.read_bytes(), type=SpanNotes)
    except FileNotFoundError:
        return None
    except (OSError, msgspec.MsgspecError, UnicodeDecodeError) as error:
        _log.warning("what dated the journal before is not known", file=str(path), why=str(error))
        return None


def _dated_alike(one: DatedSpan, other: DatedSpan) -> bool:
    same_start = one.boot == other.boot != ""
    return same_start and abs(one.base_ns - other.base_ns) <= SAME_BASE_NS


def _stated(span: DatedSpan, last: DatedSpan, offset: ClockOffset, now_ns: int) -> ClockSpan:
    """Return what to state of an earlier span: the surer of what it found and what follows now."""
    if span.boot == last.boot != "":
        follows_ns = offset.offset_ns + last.base_ns - span.base_ns
        elapsed_ns = max(now_ns - last.base_ns + span.base_ns - span.begun_ns, 0)
        doubt_ns = offset.uncertainty_ns + round(MOST_DRIFT * elapsed_ns)
    else:
        follows_ns, doubt_ns = offset.offset_ns, offset.uncertainty_ns + SET_DOUBT_NS
    if span.offset_ns is None or span.uncertainty_ns is None or span.uncertainty_ns > doubt_ns:
        return _clock_span(span, follows_ns, doubt_ns)
    return _clock_span(span, span.offset_ns, span.uncertainty_ns)


def _clock_span(span: DatedSpan, offset_ns: int, uncertainty_ns: int) -> ClockSpan:
    return ClockSpan(
        first_number=span.first_number, offset_ns=offset_ns, uncertainty_ns=uncertainty_ns
    )
