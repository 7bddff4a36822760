"""How an agent starts: with nothing it does not need, and ready before its source is."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from structlog.testing import capture_logs

import edge_agent
from edge_agent.__main__ import COMMANDS
from edge_agent.commands import follow, prepare
from edge_agent.commands.unit_options import UnitItself
from edge_agent.mounts.boot import BootMount
from edge_agent.mounts.interface import Mount
from edge_agent.mounts.methods import make_mount
from edge_agent.sources.recording import SourceError
from shared.process import ExitCode

IMPORTED = """
import sys
import edge_agent.commands.follow
print(*{"scipy.signal", "matplotlib", "shared.simulation.walker"} & set(sys.modules))
import edge_agent.sources.simulated
print(*{"scipy.signal", "matplotlib"} & set(sys.modules))
"""


def test_an_agent_waits_for_no_library_of_simulation_or_scoring() -> None:
    project = Path(edge_agent.__file__).parents[1]
    told = subprocess.run(
        [sys.executable, "-c", IMPORTED], capture_output=True, check=True, cwd=project
    ).stdout
    assert told.split() == []


def test_a_source_is_opened_when_the_method_is_ready(monkeypatch: pytest.MonkeyPatch) -> None:
    done: list[str] = []

    def ready(mount: str, method: str | None, **_: bool) -> Mount:
        done.append(f"{mount} {method}")
        return BootMount()

    def opened(name: str, *_: object, **__: object) -> None:
        done.append(name)
        raise SourceError("no more of it is needed")

    monkeypatch.setattr(follow, "prepared_mount", ready)
    monkeypatch.setattr(follow, "open_source", opened)
    itself = UnitItself("r1", insecure=True)
    assert follow.run(itself=itself, source="phone-live:127.0.0.1:1") == ExitCode.USAGE
    assert done == ["boot None", "phone-live:127.0.0.1:1"]


@pytest.mark.parametrize("built", [True, False])
def test_a_long_wait_is_announced(monkeypatch: pytest.MonkeyPatch, built: bool) -> None:
    make_mount("boot", "eskf")
    monkeypatch.setattr(prepare, "is_built", lambda *_: built)
    with capture_logs() as logs:
        assert prepare.prepare() == ExitCode.OK
    *before, last = (entry["event"] for entry in logs)
    assert [event.split(",")[0] for event in before] == ([] if built else ["building machine code"])
    assert last == "boot method ready"


def test_help_tells_of_every_command_in_its_own_words() -> None:
    told = subprocess.run(
        [sys.executable, "-m", "edge_agent", "--help"],
        capture_output=True,
        check=True,
        text=True,
        cwd=Path(edge_agent.__file__).parents[1],
    ).stdout
    assert set(COMMANDS) <= set(told.split())
    assert "Follow one responder and publish their movement" in " ".join(told.split())
