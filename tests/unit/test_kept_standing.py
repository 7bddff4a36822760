"""After a reboot a DAP stands where it stood, unless it may have been moved."""

from __future__ import annotations

from pathlib import Path

import pytest
from structlog.testing import capture_logs

from dap_node import kept_standing
from dap_node.installation import MOST_OFF_NS, Machine, StandingNote, why_elsewhere
from dap_node.kept_standing import KeptStanding
from shared.units import NS_PER_S

NOTED_NS = 1_700_000_000 * NS_PER_S
NOTE = StandingNote(
    incident="harbour", said=b"place", boot="b1", steady_ns=50 * NS_PER_S, noted_ns=NOTED_NS
)
MINUTE_NS = 60 * NS_PER_S


@pytest.mark.parametrize(
    ("incident", "machine", "why"),
    [
        ("harbour", Machine("b1", NOTE.steady_ns + MINUTE_NS, 0), None),
        ("harbour", Machine("b2", 0, NOTED_NS + MINUTE_NS), None),
        ("school", Machine("b1", NOTE.steady_ns, NOTED_NS), "in another incident, 'harbour'"),
        ("harbour", Machine("b1", NOTE.steady_ns + MOST_OFF_NS + 1, NOTED_NS), "off for 15 min"),
        ("harbour", Machine("b2", 0, NOTED_NS + 3600 * NS_PER_S), "off for 60 minutes"),
        ("harbour", Machine("b2", 0, NOTED_NS - 1), "the clock was set back"),
        ("harbour", Machine("", NOTE.steady_ns, NOTED_NS - 1), "the clock was set back"),
    ],
)
def test_it_stands_there_still_unless(incident: str, machine: Machine, why: str | None) -> None:
    found = why_elsewhere(NOTE, incident, machine)
    assert (found is None) == (why is None)
    assert why is None or (found is not None and why in found)


@pytest.fixture
def journal(tmp_path: Path) -> Path:
    return tmp_path / "dap1.journal"


def test_what_was_said_last_outlives_the_process(journal: Path) -> None:
    kept = KeptStanding(journal, "harbour", "dap1")
    assert kept.load() is None
    kept.keep(b"first")
    kept.keep(b"second")
    assert KeptStanding(journal, "harbour", "dap1").load() == b"second"
    assert KeptStanding(journal, "harbour", "dap2").load() is None
    kept.keep(None)
    assert kept.load() is None


def test_a_place_of_another_incident_is_known_to_be_old(journal: Path) -> None:
    KeptStanding(journal, "harbour", "dap1").keep(b"place")
    with capture_logs() as logs:
        assert KeptStanding(journal.with_name("other"), "school", "dap1").load() is None
    assert "another incident" in logs[0]["why"]


def test_a_note_that_cannot_be_read_is_said(journal: Path) -> None:
    journal.with_name("dap-dap1.standing").write_text("{")
    with capture_logs() as logs:
        assert KeptStanding(journal, "harbour", "dap1").load() is None
    assert "not known" in logs[0]["event"]


def test_that_it_is_at_work_is_noted_now_and_then(
    journal: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    kept = KeptStanding(journal, "harbour", "dap1")
    kept.keep(b"place")
    note = journal.with_name("dap-dap1.standing")
    before = note.read_bytes()
    kept.keep(b"place")
    assert note.read_bytes() == before
    monkeypatch.setattr(kept_standing, "AGAIN_S", 0.0)
    kept.keep(b"place")
    assert note.read_bytes() != before
