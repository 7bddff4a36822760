"""What the programs say of themselves, and of places and files that they cannot use."""

from __future__ import annotations

from pathlib import Path

import pytest
from cyclopts import App
from structlog.testing import capture_logs

import command_post.__main__
import dap_node.__main__
import edge_agent.__main__
from command_post.recorder.file import RecordingFile
from dap_node.commands import rehearse
from shared.files import held_alone
from shared.process import ExitCode

POST, DAP, AGENT = command_post.__main__.app, dap_node.__main__.app, edge_agent.__main__.app


def told(app: App, *arguments: object) -> str:
    """Run a command that refuses what it is given; return what it says."""
    with capture_logs() as logs:
        code = app([*map(str, arguments)], exit_on_error=False, result_action="return_value")
    assert code == ExitCode.USAGE
    (log,) = logs
    return str(log["event"])


@pytest.mark.parametrize("app", [POST, DAP, AGENT], ids=lambda app: app.name[0])
def test_help_begins_with_an_example(app: App, capsys: pytest.CaptureFixture[str]) -> None:
    app(["--help"], exit_on_error=False, result_action="return_value")
    assert f"Example: {app.name[0]} " in capsys.readouterr().out


def test_a_rehearsal_cannot_go_into_a_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rehearse, "quieten_logging", lambda: None)
    place = tmp_path / "file"
    place.touch()
    for app in (DAP, AGENT):
        assert str(place) in told(app, "rehearse", "corridor", "--output", place)


@pytest.mark.parametrize("name", ["demo", "demo/logs"])
def test_a_demo_cannot_go_where_a_file_is(tmp_path: Path, name: str) -> None:
    place = tmp_path / name
    place.parent.mkdir(exist_ok=True)
    place.touch()
    said = told(POST, "demo", "--scenario", "corridor", "--output", tmp_path / "demo")
    assert said.startswith(str(place))
    assert said.endswith("give another --output")


def test_two_demos_cannot_share_a_folder(tmp_path: Path) -> None:
    with held_alone(tmp_path):
        said = told(POST, "demo", "--scenario", "corridor", "--output", tmp_path)
    assert said == f"{tmp_path}: another process is at work there"


def test_a_recording_that_no_post_made_is_named(tmp_path: Path) -> None:
    path = tmp_path / "other.mcap"
    RecordingFile(path, {}).finish()
    assert told(POST, "replay", path) == (
        f"{path}: does not say its settings; give one that a post made"
    )
