"""Who goes on with another process's work goes by its clock, however it was set meanwhile."""

from __future__ import annotations

from pathlib import Path

import pytest
from structlog.testing import capture_logs

from shared import clock, clock_spans
from shared.continued_clock import continued_clock
from shared.units import NS_PER_S

HOUR_NS = 3600 * NS_PER_S


@pytest.fixture
def note(tmp_path: Path) -> Path:
    return tmp_path / "a.mcap.clock"


def test_a_clock_that_was_set_meanwhile_changes_nothing(
    note: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = continued_clock(note, goes_on=False)
    monkeypatch.setattr(clock, "_BASE_NS", first.base_ns + HOUR_NS)
    assert continued_clock(note, goes_on=True).base_ns == first.base_ns
    # And once more: what was handed on is handed on.
    assert continued_clock(note, goes_on=True).base_ns == first.base_ns
    assert continued_clock(note, goes_on=False).base_ns == first.base_ns + HOUR_NS


@pytest.mark.parametrize("named", ["another", ""])
def test_a_machine_that_was_started_anew_has_its_own(
    note: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, named: str
) -> None:
    first = continued_clock(note, goes_on=False)
    (tmp_path / "boot_id").write_text(named)
    monkeypatch.setattr(clock_spans, "BOOT_ID", tmp_path / "boot_id")
    monkeypatch.setattr(clock, "_BASE_NS", first.base_ns + HOUR_NS)
    for _ in "ab":
        assert continued_clock(note, goes_on=True).base_ns == first.base_ns + HOUR_NS


def test_a_note_that_cannot_be_read_or_written_is_told_of(note: Path) -> None:
    note.write_bytes(b"\xff")
    with capture_logs() as logs:
        continued_clock(note, goes_on=True)
        continued_clock(note.parent / "absent" / "a", goes_on=False)
    assert [entry["log_level"] for entry in logs] == ["warning", "warning"]
