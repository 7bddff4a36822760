"""Salvaging and verifying recordings: what can be read is kept, and what is missing is said."""

from __future__ import annotations

from pathlib import Path

import msgspec
import pytest
from mcap.reader import make_reader

from command_post.__main__ import app
from command_post.recorder.file import RecorderError, RecordingFile
from command_post.recorder.salvage import salvage
from command_post.recorder.verification import Verification, verify_recording
from shared.codec import encode
from shared.mcap_reader import RecordingError, read_recording
from shared.process import ExitCode
from shared.seal import sealed
from tests.conftest import CHECKOUT
from tests.traffic import START_NS, increment, key_of, traffic

RECORDINGS = CHECKOUT / "recordings"
RUN = b"12345678"


def command(*arguments: str) -> int:
    code = app(list(arguments), exit_on_error=False, result_action="return_value")
    assert isinstance(code, int)
    return code


def journalled(path: Path, numbers: list[int]) -> Path:
    file = RecordingFile(path, {"incident": "test"})
    key = key_of("responder", "r1", "increment")
    for number in numbers:
        file.put(key, sealed(encode(increment(number)), RUN, number), START_NS + number)
    file.finish()
    return path


def broken_off(folder: Path) -> tuple[Path, int]:
    file = RecordingFile(folder / "a.mcap", {"incident": "test"})
    sent = list(traffic(12))
    for number, (time_ns, key, payload) in enumerate(sent, 1):
        file.put(key, payload, time_ns)
        if number % 10 == 0:
            file.sync()
    file.sync()
    file.abandon()
    return folder / "a.mcap.part", len(sent)


def test_what_was_broken_off_is_whole_again(tmp_path: Path) -> None:
    part, count = broken_off(tmp_path)
    before = part.read_bytes()
    report = salvage(part, tmp_path / "new.mcap")
    assert (report.message_count, report.finished) == (count, False)
    new = read_recording(tmp_path / "new.mcap")
    assert list(new) == list(read_recording(part))
    assert new.report.finished
    assert new.metadata["salvaged_from"] == "a.mcap.part"
    assert part.read_bytes() == before
    with (tmp_path / "new.mcap").open("rb") as stream:
        assert sum(1 for _ in make_reader(stream).iter_messages()) == count


def test_flipped_bytes_cost_their_chunk_alone(tmp_path: Path) -> None:
    part, count = broken_off(tmp_path)
    data = bytearray(part.read_bytes())
    data[len(data) // 2] ^= 0xFF
    part.write_bytes(data)
    report = salvage(part, tmp_path / "new.mcap")
    assert len(report.damages) == 1
    assert count - 12 <= report.message_count < count
    kept = [message.payload for message in read_recording(tmp_path / "new.mcap")]
    assert len(kept) == report.message_count


def test_nothing_is_written_where_nothing_can_be(tmp_path: Path) -> None:
    (tmp_path / "x").write_text("something else")
    with pytest.raises(RecordingError, match="not an MCAP file"):
        salvage(tmp_path / "x", tmp_path / "new.mcap")
    part, _ = broken_off(tmp_path)
    (tmp_path / "new.mcap").write_text("somebody's")
    with pytest.raises(RecorderError, match="is there already"):
        salvage(part, tmp_path / "new.mcap")
    assert (tmp_path / "new.mcap").read_text() == "somebody's"


def test_a_recording_of_ours_is_whole() -> None:
    told = verify_recording(RECORDINGS / "four_daps.mcap")
    assert told.whole
    assert told.received["increment"] > 100
    assert told.made["track"] > 100
    assert command("verify", str(RECORDINGS / "four_daps.mcap")) == ExitCode.OK


def test_a_gap_in_a_journal_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = journalled(tmp_path / "a.mcap", [1, 2, 3, 6, 6, 7])
    assert command("verify", str(path), "--json") == ExitCode.FAILURE
    told = msgspec.json.decode(capsys.readouterr().out, type=Verification)
    (gaps,) = told.journals
    assert (gaps.node_id, gaps.last_number, gaps.missing) == ("r1", 7, 2)
    assert told.repeated == 1
    assert not told.whole
    assert verify_recording(journalled(tmp_path / "b.mcap", [1, 2, 3])).whole


def test_the_same_messages_have_the_same_hash(tmp_path: Path) -> None:
    one = verify_recording(journalled(tmp_path / "a.mcap", [1, 2, 3]))
    salvage(tmp_path / "a.mcap", tmp_path / "b.mcap")
    other = verify_recording(tmp_path / "b.mcap")
    assert one.messages_sha256 == other.messages_sha256
    assert one.files[0].sha256 != other.files[0].sha256
    third = verify_recording(journalled(tmp_path / "c.mcap", [1, 2]))
    assert third.messages_sha256 != one.messages_sha256


def test_what_is_no_recording_is_refused(tmp_path: Path) -> None:
    assert command("verify", str(tmp_path / "none.mcap")) == ExitCode.USAGE
