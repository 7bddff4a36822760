"""A journal that several processes have dated: each part has the offset of its own."""

from __future__ import annotations

from pathlib import Path

import pytest
from structlog.testing import capture_logs

from shared.clock_spans import (
    MOST_SPANS,
    ClockSpans,
    DatedSpan,
    SpanNotes,
    stated_spans,
    with_span,
)
from shared.clock_sync import ClockOffset
from shared.messages import ClockSpan
from shared.units import NS_PER_S

RUN, ANOTHER = b"journal1", b"journal2"
BASE_NS = 1_700_000_000 * NS_PER_S
UP_NS = 500 * NS_PER_S
"""For so long the machine has been up when its clock is read."""

MS = 1_000_000


def span(first_number: int, set_by_s: float = 0.0, boot: str = "boot1") -> DatedSpan:
    """Return a span that a clock has dated which was ``set_by_s`` ahead of the first one."""
    base_ns = BASE_NS + round(set_by_s * NS_PER_S)
    return DatedSpan(
        first_number=first_number, begun_ns=base_ns + UP_NS, boot=boot, base_ns=base_ns
    )


def stated(
    tmp_path: Path, spans: list[DatedSpan], offset_s: float, later_s: float = 10.0
) -> tuple[ClockSpan, ...]:
    """Return what the last of some processes states, which is off by ``offset_s``."""
    for each in spans:
        notes = ClockSpans(tmp_path / "j.clock", RUN, each)
    now_ns = spans[-1].begun_ns + round(later_s * NS_PER_S)
    return notes.stated(RUN, ClockOffset(round(offset_s * NS_PER_S), 5 * MS, 0.0), now_ns)


def test_who_dated_all_of_a_journal_has_nothing_to_tell_apart(tmp_path: Path) -> None:
    assert stated(tmp_path, [span(1)], 40.0) == ()
    # The clock was not set meanwhile, or nothing was said.
    assert stated(tmp_path, [span(50), span(70, 0.0005)], 40.0) == ()
    assert stated(tmp_path, [span(90, 60.0), span(90, -60.0)], 40.0)[1:] == (
        ClockSpan(first_number=90, offset_ns=40 * NS_PER_S, uncertainty_ns=5 * MS),
    )


@pytest.mark.parametrize("step_s", [60.0, -60.0, 3 * 3600.0])
def test_a_clock_that_was_set_between_two_processes_tells_of_the_earlier(
    tmp_path: Path, step_s: float
) -> None:
    earlier, now = stated(tmp_path, [span(1), span(80, step_s)], 7.0)
    assert now == ClockSpan(first_number=80, offset_ns=7 * NS_PER_S, uncertainty_ns=5 * MS)
    assert earlier.first_number == 1
    # What the first clock read was less by the step.
    assert abs(earlier.offset_ns - round((7.0 + step_s) * NS_PER_S)) <= earlier.uncertainty_ns
    assert earlier.uncertainty_ns <= 10 * MS


def test_what_an_earlier_process_found_out_counts_once_the_machine_was_started_anew(
    tmp_path: Path,
) -> None:
    first = ClockSpans(tmp_path / "j.clock", RUN, span(1))
    first.stated(RUN, ClockOffset(-3 * NS_PER_S, 8 * MS, 0.0), BASE_NS + UP_NS)
    spans = stated(tmp_path, [span(30, 999.0, "boot2")], 7.0)
    assert spans[0] == ClockSpan(first_number=1, offset_ns=-3 * NS_PER_S, uncertainty_ns=8 * MS)


def test_else_the_clock_is_taken_to_have_run_on_and_that_is_not_sure(tmp_path: Path) -> None:
    spans = stated(tmp_path, [span(1), span(30, 20.0, "boot2")], 7.0)
    assert spans[0].offset_ns == 7 * NS_PER_S
    assert spans[0].uncertainty_ns >= 60 * NS_PER_S
    unnamed = stated_spans([span(1, boot=""), span(30, 20.0, "")], ClockOffset(0, 0, 0.0), 10**18)
    assert unnamed[0].uncertainty_ns >= 60 * NS_PER_S


def test_another_journal_begins_with_nothing(tmp_path: Path) -> None:
    ClockSpans(tmp_path / "j.clock", RUN, span(1))
    notes = ClockSpans(tmp_path / "j.clock", ANOTHER, span(1, 60.0))
    offset = ClockOffset(0, 0, 0.0)
    assert notes.stated(ANOTHER, offset, BASE_NS) == ()
    assert notes.stated(RUN, offset, BASE_NS) == ()


def test_there_is_an_end_to_what_is_noted() -> None:
    notes: SpanNotes | None = None
    for number in range(1, 3 * MOST_SPANS):
        notes = with_span(notes, RUN, span(number, 60.0 * number))
    assert notes is not None
    assert len(notes.spans) == MOST_SPANS
    assert notes.spans[-1].first_number == 3 * MOST_SPANS - 1


@pytest.mark.parametrize("content", [b"", b"\xff\xfe", b"{}", b'{"run": "x", "spans": []}'])
def test_notes_that_cannot_be_read_are_told_of_and_begun_anew(
    tmp_path: Path, content: bytes
) -> None:
    (tmp_path / "j.clock").write_bytes(content)
    with capture_logs() as logs:
        assert stated(tmp_path, [span(1)], 40.0) == ()
    assert "is not known" in logs[0]["event"]
    with capture_logs() as logs:
        assert len(stated(tmp_path, [span(1), span(9, 60.0)], 40.0)) == 2
    assert not logs


def test_a_disk_that_takes_no_notes_is_told_of_once(tmp_path: Path) -> None:
    with capture_logs() as logs:
        notes = ClockSpans(tmp_path / "absent" / "j.clock", RUN, span(1))
        for minute in range(3):
            now_ns = BASE_NS + 120 * minute * NS_PER_S
            assert notes.stated(RUN, ClockOffset(0, 0, 0.0), now_ns) == ()
    assert [entry["event"] for entry in logs] == ["which clock dated what is not noted"]
