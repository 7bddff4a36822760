"""Dumps of what a radio heard: written, read, played."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from structlog.testing import capture_logs

from dap_node.scanners.dump import EMPTY_SCAN_NS, as_lines, only_known, played, read_dump
from dap_node.scanners.recorded import RecordedScanner
from shared.messages import StationTable
from shared.radios.readings import RadioScan, Reading, ScannerError
from shared.stations import Stations
from shared.units import NS_PER_S

A, B = "02:00:5e:10:00:01", "f0000000-0000-4000-8000-00000000000a/1/2"
BEGIN_NS = 1_700_000_000 * NS_PER_S

READINGS = st.builds(
    Reading,
    st.sampled_from([A, B]),
    st.floats(-120.0, 0.0),
    st.integers(0, 1000).map(lambda ms: ms * 1_000_000),
    st.none() | st.floats(-120.0, 0.0),
    st.lists(st.floats(-120.0, 0.0), max_size=4).map(tuple),
    st.lists(st.sampled_from([A, B]), max_size=2).map(tuple),
)
SCANS = st.lists(
    st.builds(RadioScan, st.integers(0, 2**62), st.lists(READINGS, max_size=4).map(tuple)),
    min_size=1,
    unique_by=lambda scan: scan.time_ns,
).map(sorted)


@given(SCANS)
def test_what_is_written_is_read(
    tmp_path_factory: pytest.TempPathFactory, scans: list[RadioScan]
) -> None:
    path = tmp_path_factory.mktemp("dump") / "dump.jsonl"
    path.write_bytes(b"".join(map(as_lines, scans)))
    assert read_dump(path) == scans


def test_a_dump_of_another_program_is_read_as_it_is_documented(tmp_path: Path) -> None:
    path = tmp_path / "dump.jsonl"
    path.write_text(
        '{"time_ns": 5, "station": "02-00-5E-10-00-01", "rssi_dbm": -47, "channel": 6}\n'
        f'{{"time_ns": 5, "station": "{B}", "rssi_dbm": -60.5, "age_ms": 12.5}}\n\n'
        '{"time_ns": 9}\n'
        '{"time_ns": 10, "stat'
    )
    with capture_logs() as logs:
        scans = read_dump(path)
    assert scans == [
        RadioScan(5, (Reading(A, -47.0), Reading(B, -60.5, 12_500_000))),
        RadioScan(9, ()),
    ]
    assert "cut off" in logs[0]["event"]


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("", "no whole line in it"),
        ('{"time_ns": 5}\n{"time_ns": 4}\n', "line 2: time_ns is before"),
        ('{"time_ns": 5, "station": "r1", "rssi_dbm": -47}\n', "line 1: address 'r1'"),
        (f'{{"time_ns": 5, "station": "{A}"}}\n', "line 1: a station without rssi_dbm"),
        (f'{{"time_ns": 5, "station": "{A}", "rssi_dbm": -470}}\n', "line 1: Expected `float` >="),
        ("time,station\n", "line 1: "),
        ("\xff\n", "line 1: "),
    ],
)
def test_what_is_no_dump_is_told_where(tmp_path: Path, text: str, complaint: str) -> None:
    path = tmp_path / "dump.jsonl"
    path.write_text(text, encoding="latin-1")
    with pytest.raises(ScannerError, match=complaint):
        read_dump(path)


def test_played_it_begins_when_it_is_to_and_time_goes_by_in_its_gaps() -> None:
    gap_ns = 3 * NS_PER_S
    scans = [RadioScan(7, (Reading(A, -50.0),)), RadioScan(7 + gap_ns, (Reading(A, -51.0),))]
    times_ns = [scan.time_ns for scan in played(scans, BEGIN_NS)]
    assert (times_ns[0], times_ns[-1]) == (BEGIN_NS, BEGIN_NS + gap_ns)
    steps = {after - before for before, after in pairwise(times_ns)}
    assert steps == {EMPTY_SCAN_NS}
    assert [scan.readings for scan in played(scans, BEGIN_NS) if scan.readings] == [
        scan.readings for scan in scans
    ]


def test_a_recorder_that_was_stopped_for_days_is_not_waited_for(tmp_path: Path) -> None:
    path = tmp_path / "dump.jsonl"
    path.write_bytes(b"".join(as_lines(RadioScan(at, ())) for at in (0, 10**15)))
    last = list(RecordedScanner(path).observations(BEGIN_NS))[-1]
    assert last.time_ns == BEGIN_NS + 65 * NS_PER_S


def test_strangers_are_left_out() -> None:
    table = StationTable(event_time_ns=0, sequence=0, responders=((A, "r1"),), daps=())
    scan = RadioScan(5, (Reading(A, -50.0), Reading(B, -40.0)))
    assert only_known(scan, Stations(table)) == RadioScan(5, (Reading(A, -50.0),))
