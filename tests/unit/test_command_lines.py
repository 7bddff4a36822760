"""What the programs say of themselves, and of places and files that they cannot use."""

from __future__ import annotations

import socket
from pathlib import Path

import pytest
from cyclopts import App, CycloptsError
from structlog.testing import capture_logs

import command_post.__main__
import dap_node.__main__
import edge_agent.__main__
from command_post.recorder.file import RecordingFile
from dap_node.commands import rehearse
from shared import command_line
from shared.files import HOLDING, held_alone
from shared.process import ExitCode
from shared.security.certificates import AUTHORITY_ID

RECORDING = str(Path(__file__).parents[2] / "recordings" / "four_daps.mcap")
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
    (place.parent / HOLDING).touch()
    said = told(POST, "demo", "--scenario", "corridor", "--output", tmp_path / "demo")
    assert said.startswith(str(place))
    assert said.endswith("give another --output")


def test_a_demo_does_not_clear_a_folder_of_others(tmp_path: Path) -> None:
    authority = tmp_path / "keys" / AUTHORITY_ID
    authority.mkdir(parents=True)
    said = told(POST, "demo", "--scenario", "corridor", "--output", tmp_path)
    assert said == f"{tmp_path}: is not empty, and no demo left that; give another --output"
    assert authority.is_dir()


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


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (["order", "roll-call", "--to", ""], "--to: is empty"),
        (["order", "roll-call", "--to="], "--to: is empty"),
        (["replay", ""], "an argument: is empty"),
    ],
)
def test_an_empty_value_is_told(
    words: list[str], named: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert named in refused(POST, monkeypatch, words)


def refused(app: App, monkeypatch: pytest.MonkeyPatch, words: list[str]) -> str:
    """Run a whole command line that is refused; return what it logs."""
    codes: list[int] = []
    monkeypatch.setattr(command_line, "leave", codes.append)
    monkeypatch.setattr(command_line, "configure_logging", lambda *_, **__: None)
    monkeypatch.setattr(command_line, "interrupt_on_signals", lambda: None)
    monkeypatch.setattr("sys.argv", [app.name[0], *words])
    with capture_logs() as logs:
        command_line.run_command_line(app)
    assert codes == [ExitCode.USAGE]
    return " ".join(str(each["event"]) for each in logs)


@pytest.mark.parametrize("north", ["nan", "inf", "1e9", "x"])
def test_a_place_that_is_none_is_told_by_its_option(
    north: str, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["click", "--insecure", "--responder", "r1", f"--north={north}", "--east", "2"]
    with pytest.raises(CycloptsError):
        POST(words, exit_on_error=False, result_action="return_value")
    assert "--north" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("app", "words", "named"),
    [
        (POST, ["run", "--listen", "nonsense"], "--listen 'nonsense': write tcp/HOST:PORT"),
        (POST, ["run", "--people", "none.toml"], "none.toml: no such file"),
        (POST, ["run", "--plan-image", "none.png"], "none.pgw"),
        (POST, ["run", "--tak", "tcp://127.0.0.1:99999"], "--tak 'tcp://127.0.0.1:99999': write"),
        (POST, ["run", "--tak-cert", "cert.pem"], "for --tak; give that too"),
        (AGENT, ["run", "--stands-at", "nan,0"], "--stands-at 'nan,0': north_m"),
        (AGENT, ["run", "--start", "nan", "0", "0"], "--start: north_m"),
        (AGENT, ["run", "--connect", "nonsense"], "--connect 'nonsense': write tcp/HOST:PORT"),
        (AGENT, ["run", "--source", "csv:none.csv"], "none.csv is not there"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_what_cannot_be_used_is_told_before_machine_code_is_built(
    app: App, words: list[str], named: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def built(*_: object, **__: object) -> None:
        pytest.fail("built first")

    monkeypatch.setattr("command_post.commands.live.make_ready", built)
    monkeypatch.setattr("edge_agent.commands.follow.prepared_mount", built)
    needed = ["--id", "r1", "--source", "simulated:corridor"] if app is AGENT else []
    with capture_logs() as logs:
        code = app(
            [*words, *needed[: 2 if "--source" in words else 4], "--insecure"],
            exit_on_error=False, result_action="return_value",
        )  # fmt: skip
    assert code == ExitCode.USAGE
    assert named in str(logs[-1]["event"])


@pytest.mark.parametrize(
    "words",
    [
        ["score", RECORDING, "--picture"],
        ["afterwards", RECORDING, "--output"],
        ["rehearse", "corridor", "--output"],
        ["montecarlo", "--scenario", "corridor", "--picture"],
        ["plan", "offices", "--output"],
    ],
    ids=lambda words: words[0],
)
def test_where_nothing_can_be_written_is_told_before_the_work(
    words: list[str], tmp_path: Path
) -> None:
    for place in (tmp_path, tmp_path / "none" / "x"):
        assert told(POST, *words, place).startswith(f"{words[-1]} {place}: ")


def test_a_post_whose_port_is_taken_begins_no_recording(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("command_post.commands.live.make_ready", lambda _: None)
    with socket.create_server(("127.0.0.1", 0)) as taken, capture_logs() as logs:
        port = taken.getsockname()[1]
        record, metrics = tmp_path / "a.mcap", f"127.0.0.1:{port}"
        code = POST(
            ["run", "--insecure", "--listen", "tcp/127.0.0.1:0", "--metrics", metrics,
             "--record", str(record)],
            exit_on_error=False, result_action="return_value",
        )  # fmt: skip
    assert code == ExitCode.USAGE
    assert "use another port" in str(logs[-1]["event"])
    assert list(tmp_path.iterdir()) == []
