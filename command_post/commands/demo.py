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
from command_post.demo import DemoError, run_demo, why_told_late
from command_post.demo_settings import DemoSettings
from command_post.evaluation.errors import measure
from command_post.evaluation.score_card import score
from command_post.rehearsing.rehearsal import BootMethod
from shared.config import ConfigError
from shared.files import FolderHeldError, held_alone, replace_atomically
from shared.mcap_reader import RecordingError, read_recording
from shared.node_options import Seed
from shared.process import ExitCode, quieten_logging, stop_on_signals
from shared.recording_parts import where_part_is
from shared.simulation.scenario import load_scenario

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
        Folder for what it leaves, an empty one or an earlier demo's: what that left is replaced.
    json
        Print the score as one JSON object, and no table.

    """
    with ExitStack() as held:
        try:
            loaded = load_scenario(scenario)
            settings = DemoSettings(
                scenario, loaded, seed, speed, method, output, shows_table=not json
            )
            settings.claim()
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
    try:
        with stop_on_signals() as stop:
            finished = run_demo(settings, stop, _say)
        _tell_recording(settings)
        return _tell(settings, json=json) if finished else ExitCode.INTERRUPTED
    except DemoError as error:
        _log.error(str(error))
        _tell_recording(settings)
    except (RecordingError, OSError) as error:
        _log.error(str(error))
    return ExitCode.FAILURE


def _say(text: str) -> None:
    """Print a line to standard error as it is: a path is not to be broken."""
    Console(stderr=True).print(text, highlight=False, markup=False, soft_wrap=True)


def _tell_recording(settings: DemoSettings) -> None:
    """Say where the recording is, if there is one, and how to look at it."""
    recording = where_part_is(settings.recording, 1)
    if recording is None:
        return
    _say(f"recording: {recording}")
    if recording != settings.recording:
        _say("  it is unfinished: 'command-post salvage' makes a whole one of it")
    _say(f"  to see it in the page again: command-post review {recording}")


def _tell(settings: DemoSettings, *, json: bool) -> int:
    """Score the recording of a demo that has ended, and say where its picture is."""
    evidence = read_evidence(settings.recording)
    late = why_told_late(read_recording(settings.recording), settings)
    told = score(measure(evidence))
    with replace_atomically(settings.score) as file:
        file.write(msgspec.json.format(msgspec.json.encode(told)))
    show_score(told, evidence, settings.scenario.building, picture=settings.picture, json=json)
    _say(f"picture: {settings.picture}")
    if late is not None:
        _say(late)
    return ExitCode.OK
