"""A message that ends the process itself, or never ends, is met twice and no more."""

from __future__ import annotations

import signal
import subprocess
import sys
from pathlib import Path

from command_post.incident import Incident
from command_post.replay import replay
from command_post.resuming.handling import Handling, handling_path
from command_post.resuming.watcher import MOST_TICKS, Watcher
from shared.mcap_reader import read_recording
from shared.process import ExitCode
from tests.unit.test_post import SETTINGS


def serve(folder: Path, how: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "tests.faults.poisoned", str(folder), how]
    return subprocess.run(command, capture_output=True, text=True, check=False, timeout=240)


def test_what_kills_the_post_twice_is_put_aside_and_in_a_replay_as_well(tmp_path: Path) -> None:
    for _ in range(2):
        assert serve(tmp_path, "kill").returncode == -signal.SIGKILL
    survived = serve(tmp_path, "kill")
    assert survived.returncode == 0, survived.stderr
    begun_from, _, name = survived.stdout.splitlines()[-1].partition(" ")
    assert begun_from == "all"
    assert name.startswith("fusing clew/v1/fire/responder/r1/fix")
    assert "the post ended amid handling" in survived.stdout + survived.stderr
    recording = read_recording(tmp_path / "a.mcap")
    assert recording.put_aside() == {name}
    incident = Incident(SETTINGS)
    report = replay(tmp_path / "a.mcap", incident)
    assert report.identical, report
    assert report.equal > 10
    assert incident.refusals == {("failed_Fatal", "r1"): 1}


def test_what_never_ends_is_told_and_ended(tmp_path: Path) -> None:
    hung = serve(tmp_path, "hang")
    assert hung.returncode == ExitCode.FAILURE
    said = hung.stdout + hung.stderr
    assert "the post does not get on" in said
    assert "poisoned.py" in said
    ends = Handling(handling_path(tmp_path / "a.mcap"), goes_on=True).ends
    assert len(ends.at) == ends.in_row == 1
    assert ends.at[0].startswith("fusing clew/v1/fire/responder/r1/fix")
    assert ends.put_aside == []


def test_starts_that_end_are_counted_until_one_lasts(tmp_path: Path) -> None:
    path = tmp_path / "a.handling"
    for number, what in enumerate(["a", "b", "a", "c"], 1):
        handling = Handling(path, goes_on=number > 1)
        assert handling.ends.in_row == number - 1
        handling.begin("something")
        handling.end()
        handling.begin(what)
    lasting = Handling(path, goes_on=True)
    ends = lasting.ends
    assert (ends.at, ends.put_aside, ends.in_row) == (["a", "b", "a", "c"], ["a"], 4)
    lasting.prove()
    lasting.begin("d")
    between_two = Handling(path, goes_on=True)
    ends = between_two.ends
    assert (ends.at[-1], ends.put_aside, ends.in_row) == ("d", ["a"], 1)
    assert Handling(path, goes_on=True).ends.in_row == 0
    path.write_bytes(b"garbage")
    assert Handling(path, goes_on=True).ends.at == []


def test_only_who_does_not_get_on_is_ended(tmp_path: Path) -> None:
    handling, ended = Handling(tmp_path / "a.handling", goes_on=False), list[int]()
    watcher = Watcher(handling, lambda: ended.append(1))
    for number in range(2 * MOST_TICKS):
        handling.begin(str(number))
        watcher.look()
    handling.end()
    for _ in range(2 * MOST_TICKS):
        watcher.look()
    assert not ended
    assert Handling(tmp_path / "a.handling", goes_on=True).ends.at == []
    handling.begin("stuck")
    for _ in range(MOST_TICKS):
        watcher.look()
    assert not ended
    watcher.look()
    assert ended
