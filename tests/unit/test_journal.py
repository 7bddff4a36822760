"""The journal keeps what it was given, whatever becomes of the process, the power and the disk."""

from __future__ import annotations

import os
import shutil
import sqlite3
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest
from structlog.testing import capture_logs

from shared.files import FileHeldError
from shared.journal import KEPT_NS, ForeignFileError, Journal, JournalError
from shared.seal import RUN_BYTES
from tests.faults.torn import SAID_BEFORE, Torture

KEY = "clew/v1/fire/responder/r1/increment"


def said(run: bytes, number: int) -> bytes:
    return run + b"said %d" % number + bytes(1000)


def filled(path: Path, count: int, *, acknowledged: int = 0, now_ns: int = 1) -> bytes:
    """Make a journal of ``count`` messages and close it; return its run."""
    journal = Journal(path, lambda: now_ns)
    for _ in range(count):
        journal.append(KEY, said)
    journal.acknowledge(acknowledged)
    journal.close()
    return journal.run


@contextmanager
def opened(path: Path, now_ns: int = 1) -> Iterator[Journal]:
    journal = Journal(path, lambda: now_ns)
    try:
        yield journal
    finally:
        journal.close()


def numbers(journal: Journal) -> list[int]:
    rows = journal.rows(0, 2**62, 10**6, 10**9)
    assert all(row.payload == said(journal.run, row.number) for row in rows)
    return [row.number for row in rows]


def test_what_was_said_is_there_again_and_numbers_go_on(tmp_path: Path) -> None:
    path = tmp_path / "new" / "r1.journal"
    run = filled(path, 3, acknowledged=2)
    with opened(path) as journal:
        assert not journal.broken_off
        assert journal.append(KEY, said) == said(run, 4)
        assert numbers(journal) == [1, 2, 3, 4]
        assert journal.holding()[:4] == (run, 4, 1, 2)
        assert journal.newest(KEY) == said(run, 4)
        assert journal.newest(KEY + "s") is None
    assert len(run) == RUN_BYTES


def test_each_file_has_a_run_of_its_own(tmp_path: Path) -> None:
    assert filled(tmp_path / "a", 1) != filled(tmp_path / "b", 1)


def test_a_journal_killed_in_use_says_so_once(tmp_path: Path) -> None:
    path, copy = tmp_path / "r1", tmp_path / "copy"
    with opened(path) as journal:
        journal.append(KEY, said)
        for part in tmp_path.glob("r1*"):
            shutil.copy(part, copy.with_name(part.name.replace("r1", "copy")))
    for broken_off in (True, False):
        with capture_logs() as logs, opened(copy) as journal:
            assert journal.broken_off is broken_off
            assert numbers(journal) == [1]
        assert [entry["event"].partition(":")[0] for entry in logs] == (
            ["the journal was not closed"] if broken_off else []
        )


def test_rows_are_bounded_by_count_and_by_bytes(tmp_path: Path) -> None:
    filled(tmp_path / "r1", 20)
    with opened(tmp_path / "r1") as journal:
        one = len(KEY) + len(said(journal.run, 1))
        assert [row.number for row in journal.rows(3, 15, 4, 10**6)] == [3, 4, 5, 6]
        assert [row.number for row in journal.rows(3, 15, 9, 2 * one)] == [3, 4]
        assert [row.number for row in journal.rows(3, 15, 9, 0)] == [3]
        assert journal.rows(21, 30, 9, 10**6) == []
        assert journal.rows(5, 4, 9, 10**6) == []


def test_only_what_is_long_acknowledged_is_trimmed(tmp_path: Path) -> None:
    path = tmp_path / "r1"
    run = filled(path, 4, acknowledged=3)
    with opened(path, now_ns=KEPT_NS) as journal:
        journal.trim()
        assert numbers(journal) == [1, 2, 3, 4]
    with opened(path, now_ns=KEPT_NS + 2) as journal:
        journal.trim()
        assert numbers(journal) == [4]
        assert journal.holding()[:4] == (run, 4, 4, 3)
        journal.acknowledge(4)
        journal.trim()
    with opened(path) as journal:
        assert journal.append(KEY, said) == said(run, 5)


def test_acknowledgements_do_not_go_back_nor_beyond_what_was_said(tmp_path: Path) -> None:
    path = tmp_path / "r1"
    filled(path, 4, acknowledged=3)
    with opened(path) as journal:
        for number in (2, 5, -1):
            journal.acknowledge(number)
            assert journal.holding().acknowledged == 3


def test_two_processes_do_not_share_a_journal(tmp_path: Path) -> None:
    with opened(tmp_path / "r1"), pytest.raises(FileHeldError, match="another process has it"):
        Journal(tmp_path / "r1")
    with opened(tmp_path / "r1"):
        pass


def limit_pages(journal: Journal, spare: int) -> None:
    """Let the file grow by no more than ``spare`` pages, as on a disk that is full."""
    pages = journal._writer.execute("PRAGMA page_count").fetchone()[0]
    journal._writer.execute(f"PRAGMA max_page_count = {pages + spare}")


def append_until_full(journal: Journal) -> int:
    """Return the number of the first message that does not go in."""
    for _ in range(10_000):
        try:
            journal.append(KEY, said)
        except JournalError:
            return journal.holding().last_number + 1
    raise AssertionError("never full")


def test_on_a_full_disk_old_acknowledged_messages_make_room(tmp_path: Path) -> None:
    path = tmp_path / "r1"
    filled(path, 300, acknowledged=150)
    with capture_logs() as logs, opened(path) as journal:
        limit_pages(journal, 2)
        first_lost = append_until_full(journal)
        assert first_lost > 400
        assert numbers(journal) == list(range(151, first_lost))
        assert journal.holding().kept_from == 151
        limit_pages(journal, 2)
        assert journal.append(KEY, said) == said(journal.run, first_lost)
        assert "old acknowledged messages have made room" in logs[0]["event"]


def test_what_is_not_acknowledged_makes_no_room(tmp_path: Path) -> None:
    path = tmp_path / "r1"
    filled(path, 50)
    with opened(path) as journal:
        limit_pages(journal, 1)
        lost = append_until_full(journal)
        assert numbers(journal) == list(range(1, lost))
        with pytest.raises(JournalError, match="r1: database or disk is full"):
            journal.append(KEY, said)


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """Give a file system of 3 MB."""
    disk = tmp_path / "disk"
    disk.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=3m", "tmpfs", str(disk)]
    if os.geteuid() != 0 or subprocess.run(mount, check=False, capture_output=True).returncode:
        pytest.skip("needs to mount a small file system, as root may")
    try:
        yield disk
    finally:
        subprocess.run(["umount", "-l", str(disk)], check=True)


def fill_up(ballast: Path) -> None:
    """Leave no room on the disk that ``ballast`` is on."""
    with suppress(OSError), ballast.open("wb", buffering=0) as file:
        while True:
            file.write(bytes(4096))


def test_on_a_disk_that_is_really_full_it_makes_room_or_says_so(small_disk: Path) -> None:
    path = small_disk / "r1"
    with capture_logs(), opened(path) as journal:
        for _ in range(300):
            journal.append(KEY, said)
        journal.acknowledge(200)
        ballast = small_disk / "ballast"
        fill_up(ballast)
        lost = append_until_full(journal)
        assert lost > 300
        assert set(range(201, lost)) <= set(numbers(journal))
        ballast.unlink()
        assert journal.append(KEY, said) == said(journal.run, lost)
        journal.trim()
        assert journal._reserve.exists()


def test_a_disk_that_cannot_be_written_is_told(tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(b"")
    with pytest.raises(JournalError, match="r1"):
        Journal(tmp_path / "file" / "r1")
    (tmp_path / "folder").mkdir()
    with pytest.raises(JournalError, match="folder"):
        Journal(tmp_path / "folder")


def test_a_power_cut_at_any_byte_takes_the_unfinished_message_at_most(tmp_path: Path) -> None:
    # Every byte: python -m tests.faults.torn.
    torture = Torture(tmp_path)
    appended = torture.wrong(torture.appends(97), SAID_BEFORE)
    written_back = torture.wrong(torture.writes_back(397), SAID_BEFORE + 1)
    for found in (appended, written_back):
        assert found["cuts"] > 20
        assert +found == {"cuts": found["cuts"]}


@pytest.mark.parametrize("at_pct", [0, 10, 40, 70])
@pytest.mark.parametrize("garbage", [b"\xff" * 3000, b""], ids=["overwritten", "cut off"])
def test_a_damaged_file_is_kept_aside_and_another_begun(
    tmp_path: Path, at_pct: int, garbage: bytes
) -> None:
    path = tmp_path / "r1"
    run = filled(path, 40)
    whole = path.read_bytes()
    at = len(whole) * at_pct // 100
    rest = whole[at + len(garbage) :] if garbage else b""
    path.write_bytes(whole[:at] + garbage + rest)
    damaged = path.read_bytes()
    with capture_logs() as logs, opened(path) as journal:
        assert journal.append(KEY, said)
        if damaged:
            assert journal.run != run
            aside = path.with_name("r1.damaged1")
            assert aside.read_bytes() == damaged
            assert logs[0]["kept"] == str(aside)
    with opened(path) as journal:
        assert numbers(journal) == [1]


def test_a_message_that_the_disk_has_altered_is_not_told(tmp_path: Path) -> None:
    path = tmp_path / "r1"
    filled(path, 10)
    whole = path.read_bytes()
    path.write_bytes(whole.replace(b"said 7", b"sad 77"))
    with capture_logs() as logs, opened(path) as journal:
        assert journal.holding().lost == ()
        for _ in range(2):
            assert numbers(journal) == [1, 2, 3, 4, 5, 6, 8, 9, 10]
            assert journal.holding().lost == (7,)
        assert [log["numbers"] for log in logs if "lost" in log["event"]] == [[7]]
        assert journal.rows(8, 9, 1, 1)[0].number == 8
        # It is of no use to anybody who has all up to there.
        journal.acknowledge(7)
        assert journal.holding().lost == ()


def test_a_message_that_is_not_on_the_disk_any_more_is_lost(tmp_path: Path) -> None:
    path = tmp_path / "r1"
    filled(path, 10, acknowledged=3)
    with sqlite3.connect(path) as other:
        other.execute("DELETE FROM message WHERE number IN (1, 2, 3, 5, 8)")
    other.close()
    with opened(path) as journal:
        assert [row.number for row in journal.rows(1, 10, 3, 10**9)] == [4, 6, 7]
        assert journal.holding().lost == (5,)
        assert numbers(journal) == [4, 6, 7, 9, 10]
        assert journal.holding().lost == (5, 8)


@pytest.mark.parametrize("endings", [("", "-wal", "-shm"), ("",), ("-wal",)])
def test_a_journal_that_is_removed_while_in_use_is_written_anew(
    tmp_path: Path, endings: tuple[str, ...]
) -> None:
    path = tmp_path / "r1"
    run = filled(path, 3, acknowledged=2)
    with capture_logs() as logs, opened(path) as journal:
        journal.append(KEY, said)
        for ending in endings:
            Path(f"{path}{ending}").unlink()
        # What is asked for meanwhile is still there.
        assert numbers(journal) == [1, 2, 3, 4]
        journal.append(KEY, said)
        journal.append(KEY, said)
        assert not journal.broken_off
        assert numbers(journal) == [1, 2, 3, 4, 5, 6]
        assert sum("removed while in use" in log["event"] for log in logs) == 1
        # A power cut now.
        shutil.copytree(tmp_path, tmp_path / "cut")
    with opened(tmp_path / "cut" / "r1") as after:
        assert after.run == run
        assert numbers(after) == [1, 2, 3, 4, 5, 6]
        assert after.holding().acknowledged == 2


def test_garbage_beside_the_file_does_no_harm(tmp_path: Path) -> None:
    path = tmp_path / "r1"
    run = filled(path, 5)
    for ending in ("-wal", "-shm"):
        Path(f"{path}{ending}").write_bytes(os.urandom(5000))
    with opened(path) as journal:
        assert journal.run == run
        assert numbers(journal) == [1, 2, 3, 4, 5]


def test_another_programs_database_is_left_alone(tmp_path: Path) -> None:
    path = tmp_path / "other.db"
    with sqlite3.connect(path) as other:
        other.execute("CREATE TABLE precious (x)")
    other.close()
    before = path.read_bytes()
    with pytest.raises(ForeignFileError, match="give another --journal"):
        Journal(path)
    assert path.read_bytes() == before
