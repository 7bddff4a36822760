"""What is said is on the disk before it is heard, and is said even where the disk fails."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from structlog.testing import capture_logs

from shared.codec import encode
from shared.files import FileHeldError
from shared.journal import Journal, JournalDamagedError, JournalError
from shared.kept import Holding, SealAs
from shared.memory_journal import MemoryJournal
from shared.outbox import TRY_AGAIN_S, JournalledOutbox
from shared.seal import Seal, read_seal
from shared.topics import TOPICS
from tests.traffic import increment

KEY = "clew/v1/fire/responder/r1/increment"
HEALTH = "clew/v1/fire/responder/r1/health"
MANY = 10**6


class Disk:
    """Fails as told to; and the seconds that have passed."""

    def __init__(self) -> None:
        self.error: JournalError | None = None
        self.now_s = 100.0

    def now(self) -> float:
        """Return the seconds that have passed."""
        return self.now_s


@pytest.fixture
def disk(monkeypatch: pytest.MonkeyPatch) -> Disk:
    disk, append = Disk(), Journal.append

    def append_or_fail(self: Journal, key: str, seal_as: SealAs) -> bytes:
        if disk.error is not None:
            raise disk.error
        return append(self, key, seal_as)

    monkeypatch.setattr(Journal, "append", append_or_fail)
    return disk


@pytest.fixture
def outbox(tmp_path: Path, disk: Disk) -> Iterator[JournalledOutbox]:
    with JournalledOutbox(tmp_path / "r1", monotonic=disk.now) as outbox:
        yield outbox


def say(outbox: JournalledOutbox, number: int) -> Seal:
    seal = read_seal(outbox.seal(TOPICS["increment"], KEY, encode(increment(number))))
    assert seal is not None
    return seal


def numbers(outbox: JournalledOutbox, run: bytes) -> list[int]:
    return [row.number for row in outbox.rows(run, 1, MANY, MANY, MANY)]


def test_what_is_journalled_is_kept_and_the_rest_only_numbered(outbox: JournalledOutbox) -> None:
    whole = outbox.seal(TOPICS["increment"], KEY, encode(increment(0)))
    (holding,) = outbox.holdings()
    assert holding.last_number == 1
    assert [row.payload for row in outbox.rows(holding.run, 1, 9, 9, MANY)] == [whole]
    passing = read_seal(outbox.seal(TOPICS["health"], HEALTH, encode(increment(0))))
    assert passing is not None
    assert passing.run != holding.run
    assert outbox.holdings() == [holding]
    assert outbox.newest(KEY) == whole


def test_rows_are_kept_as_signed(tmp_path: Path) -> None:
    with JournalledOutbox(tmp_path / "r1", lambda _: b"s" * 64) as outbox:
        whole = outbox.seal(TOPICS["increment"], KEY, encode(increment(0)))
        assert outbox.newest(KEY) == whole
        assert whole.endswith(b"s" * 64)


def test_a_journal_in_use_is_refused(tmp_path: Path) -> None:
    with JournalledOutbox(tmp_path / "r1"), pytest.raises(FileHeldError):
        JournalledOutbox(tmp_path / "r1")


def test_while_the_disk_fails_it_is_said_and_kept_in_memory(
    outbox: JournalledOutbox, disk: Disk
) -> None:
    on_disk = say(outbox, 0)
    disk.error = JournalError("r1: database or disk is full")
    with capture_logs() as logs:
        in_memory = [say(outbox, number) for number in (1, 2)]
    assert [entry["log_level"] for entry in logs] == ["error"]
    assert {seal.run for seal in in_memory} == {in_memory[0].run} != {on_disk.run}
    assert [seal.number for seal in in_memory] == [1, 2]
    assert (outbox.unwritten, outbox.fault) == (2, "r1: database or disk is full")
    assert numbers(outbox, on_disk.run) == [1]
    assert numbers(outbox, in_memory[0].run) == [1, 2]
    assert [holding.run for holding in outbox.holdings()] == [on_disk.run, in_memory[0].run]
    disk.error = None
    assert say(outbox, 3).run == in_memory[0].run, "the disk is left alone for a while"
    disk.now_s += TRY_AGAIN_S
    with capture_logs() as logs:
        assert say(outbox, 4)[:2] == (on_disk.run, 2)
    assert logs[0]["event"] == "the journal is written again"
    assert outbox.fault is None
    outbox.acknowledge(in_memory[0].run, 3)
    assert [holding.run for holding in outbox.holdings()] == [on_disk.run]


def test_a_disk_that_does_not_answer_holds_nobody_up_twice(
    outbox: JournalledOutbox, disk: Disk, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("shared.outbox.PATIENCE_S", 0.1)
    on_disk, answers = say(outbox, 0), threading.Event()
    insert = Journal._insert

    def insert_late(self: Journal, row: Any) -> None:
        assert answers.wait(20.0)
        insert(self, row)

    monkeypatch.setattr(Journal, "_insert", insert_late)
    said = [say(outbox, number) for number in range(1, 4)]
    assert [seal.number for seal in said] == [1, 2, 3]
    assert said[0].run != on_disk.run
    assert outbox.fault is not None
    assert "does not answer" in outbox.fault
    assert numbers(outbox, on_disk.run) == [1]
    assert numbers(outbox, said[0].run) == [1, 2, 3]
    assert [holding.last_number for holding in outbox.holdings()] == [1, 3]
    answers.set()
    monkeypatch.setattr("shared.outbox.PATIENCE_S", 20.0)
    disk.now_s += TRY_AGAIN_S
    written = outbox._written
    assert written is not None
    written.result(20.0)
    # The one that was stuck has its number all the same: it is never given twice.
    assert say(outbox, 4)[:2] == (on_disk.run, 3)
    assert numbers(outbox, on_disk.run) == [1, 2, 3]


def test_a_journal_found_damaged_is_opened_anew(outbox: JournalledOutbox, disk: Disk) -> None:
    before = say(outbox, 0)
    disk.error = JournalDamagedError("r1: malformed")
    say(outbox, 1)
    disk.error = None
    disk.now_s += TRY_AGAIN_S
    assert say(outbox, 2)[:2] == (before.run, 2), "the file was whole after all"


def test_without_a_disk_from_the_first_all_is_in_memory(tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(b"")
    now_s = [0.0]
    path = tmp_path / "file" / "r1"
    with capture_logs() as logs, JournalledOutbox(path, monotonic=lambda: now_s[0]) as outbox:
        assert logs[0]["log_level"] == "error"
        assert not outbox.broken_off
        assert outbox.newest(KEY) is None
        in_memory = say(outbox, 0)
        (tmp_path / "file").unlink()
        now_s[0] = TRY_AGAIN_S
        assert say(outbox, 1).run != in_memory.run
        assert outbox.newest(KEY) is not None


def test_old_messages_are_trimmed_now_and_then(tmp_path: Path) -> None:
    now = [0.0]
    with JournalledOutbox(
        tmp_path / "r1", now_ns=lambda: round(now[0] * 1e9), monotonic=lambda: now[0]
    ) as outbox:
        run = [say(outbox, number) for number in range(3)][2].run
        outbox.acknowledge(run, 2)
        now[0] = 90_000.0
        outbox.tend()
        assert numbers(outbox, run) == [3]
        assert outbox.holdings() == [Holding(run, 3, 3, 2)]


def test_memory_is_bounded_and_what_is_lost_is_counted() -> None:
    journal = MemoryJournal(most_messages=3, most_bytes=100)

    def say_bytes(count: int) -> None:
        journal.append("k", lambda _run, _number: bytes(count))

    for _ in range(5):
        say_bytes(1)
    assert journal.holding()[:4] == (journal.run, 5, 3, 0)
    assert journal.lost == 2
    assert [row.number for row in journal.rows(1, 9, 2, 100)] == [3, 4]
    journal.acknowledge(3)
    journal.acknowledge(99)
    assert journal.holding()[:4] == (journal.run, 5, 4, 3)
    say_bytes(100)
    assert journal.holding().kept_from == 6
    assert journal.lost == 4
