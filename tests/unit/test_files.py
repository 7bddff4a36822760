"""Files are replaced whole or not at all."""

from __future__ import annotations

from pathlib import Path

import pytest

from shared.files import (
    FileHeldError,
    FolderHeldError,
    file_held_alone,
    held_alone,
    replace_atomically,
)


def test_the_old_file_stands_until_the_block_ends(tmp_path: Path) -> None:
    path = tmp_path / "track.json"
    path.write_bytes(b"old")
    with replace_atomically(path) as file:
        file.write(b"new")
        file.flush()
        assert path.read_bytes() == b"old"
    assert path.read_bytes() == b"new"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("fault", [RuntimeError, KeyboardInterrupt])
def test_an_error_leaves_all_as_it_was(tmp_path: Path, fault: type[BaseException]) -> None:
    path = tmp_path / "track.json"
    path.write_bytes(b"old")

    def write_half() -> None:
        with replace_atomically(path) as file:
            file.write(b"half")
            raise fault

    with pytest.raises(fault):
        write_half()
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


def test_two_writers_do_not_meet(tmp_path: Path) -> None:
    path = tmp_path / "track.json"
    with replace_atomically(path) as first, replace_atomically(path) as second:
        first.write(b"first")
        second.write(b"second")
    assert path.read_bytes() == b"first"
    assert list(tmp_path.iterdir()) == [path]


def test_an_absent_folder_is_told(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError), replace_atomically(tmp_path / "absent" / "file"):
        pass


def test_a_folder_is_held_by_one_at_a_time(tmp_path: Path) -> None:
    refused = pytest.raises(FolderHeldError, match="another process is at work there")
    with held_alone(tmp_path), refused, held_alone(tmp_path):
        pass
    with held_alone(tmp_path):
        pass


def test_a_file_in_no_folder_is_said_in_plain_words(tmp_path: Path) -> None:
    held = file_held_alone(tmp_path / "none" / "a.mcap")
    with pytest.raises(FileHeldError, match="no such folder; make it"):
        held.__enter__()
