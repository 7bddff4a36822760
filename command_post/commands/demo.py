"""``command-post demo``: a simulated incident, every node its own process."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from typing import Annotated

import msgspec
import structlog
from cyclopts import Parameter, validators
from rich.console import Console

from command_post.commands.scoring import read_evidence, show_score
from command_post.demo import DemoError, DemoSettings, run_demo, why_told_late
from command_post.evaluation.errors import measure
from command_post.evaluation.score_card import score
from command_post.rehearsing.rehearsal import BootMethod
from shared.config import ConfigError
from shared.files import FolderHeldError, held_alone, replace_atomically
from shared.mcap_reader import RecordingError, read_recording
from shared.process import ExitCode, quieten_logging, stop_on_signals
from shared.simulation.scenario import load_scenario

Seed = Annotated[int, Parameter(validator=validators.Number(gte=0))]

_log = structlog.stdlib.get_logger(__name__)


def demo(
    *,
    scenario: str = "four_daps",
    seed: Seed = 1,
    speed: Annotated[float, Parameter(validator=validators.Number(gt=0.0, lte=1000.0))] = 1.0,
    method: BootMethod | None = None,
    output: Path = Path("clew-demo"),
    json: bool = False,
) -> int:
    """Run a simulated incident, every node its own process, and score it.

    Leaves a recording, a picture of the tracks and each process's log in the output folder.
    Example: command-post demo --speed 5

    Parameters
    ----------
    scenario
        A packaged scenario's name, or a TOML file.
    seed
        Of the simulated world and of the fusion.
    speed
        How many times as fast as real.
    method
        How the agents read their boots: eskf or linear; the agents' own default if not given.
    output
        Folder for what it leaves; what an earlier demo left there is replaced.
    json
        Print the score as one JSON object, and no table.

    """
    with ExitStack() as held:
        try:
            loaded = load_scenario(scenario)
            settings = DemoSettings(
                scenario, loaded, seed, speed, method, output, shows_table=not json
            )
            settings.logs.mkdir(parents=True, exist_ok=True)
            held.enter_context(held_alone(output))
            settings.clear()
        except (ConfigError, FolderHeldError, ValueError) as error:
            _log.error(str(error))
            return ExitCode.USAGE
        except OSError as error:
            _log.error(f"{error.filename}: {error.strerror}; give another --output")
            return ExitCode.USAGE
        return _run(settings, json=json)


def _run(settings: DemoSettings, *, json: bool) -> int:
    """Run a demo to its score, or as far as it gets."""
    quieten_logging()
    console = Console(stderr=True)
    try:
        with stop_on_signals() as stop:
            finished = run_demo(settings, stop, lambda text: console.print(text, highlight=False))
        if not finished:
            console.print(f"recording: {settings.recording}", highlight=False)
            return ExitCode.INTERRUPTED
        return _tell(settings, console, json=json)
    except (DemoError, RecordingError, OSError) as error:
        _log.error(str(error))
        return ExitCode.FAILURE


def _tell(settings: DemoSettings, console: Console, *, json: bool) -> int:
    """Score the recording of a demo that has ended, and say where its files are."""
    console.print(f"recording: {settings.recording}", highlight=False)
    evidence = read_evidence(settings.recording)
    late = why_told_late(read_recording(settings.recording), settings)
    told = score(measure(evidence))
    with replace_atomically(settings.score) as file:
        file.write(msgspec.json.format(msgspec.json.encode(told)))
    show_score(told, evidence, settings.scenario.building, picture=settings.picture, json=json)
    console.print(f"picture: {settings.picture}", highlight=False)
    if late is not None:
        console.print(late, highlight=False)
    return ExitCode.OK
