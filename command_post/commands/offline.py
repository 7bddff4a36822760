"""``command-post rehearse`` and ``command-post montecarlo``: exercises without a network."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import msgspec
import structlog
from cyclopts import Parameter, validators
from rich.console import Console
from rich.progress import Progress

from command_post.evaluation import RunErrors, pool
from command_post.fusion.settings import FusionSettings
from command_post.incident import IncidentSettings
from command_post.monte_carlo import run_many
from command_post.recording_file import RecorderError
from command_post.rehearsal import Agents, RehearsalError
from command_post.rehearsal import rehearse as rehearse_scenario
from command_post.score_table import pooled_table
from shared.config import checked
from shared.exercise import REHEARSAL_INCIDENT, OdometrySource
from shared.process import ExitCode
from shared.simulation.scenario import load_scenario

Seed = Annotated[int, Parameter(validator=validators.Number(gte=0))]
Positive = Annotated[int, Parameter(validator=validators.Number(gt=0))]

_log = structlog.stdlib.get_logger(__name__)


def rehearse(
    scenario: str,
    *,
    output: Path,
    seed: Seed = 1,
    method: str | None = None,
    odometry: OdometrySource = "imu",
    imu: bool = True,
    replace: bool = False,
) -> int:
    """Run a scenario offline and record it; the same seed gives the same file to the bit.

    Example: command-post rehearse four_daps --seed 3 --output four_daps.mcap

    Parameters
    ----------
    scenario
        A packaged scenario's name, or a TOML file.
    output
        Where the recording goes.
    seed
        Of the simulated world and of the fusion.
    method
        How the agents read their boots: eskf or linear; the agents' own default if not given.
    odometry
        Simulate the boots' sensors and read them (imu), or only the errors of strides (strides).
    imu
        Record the raw samples and readings as well.
    replace
        Replace a recording that is there already.

    """
    try:
        fusion = checked(FusionSettings(seed=seed))
        settings = IncidentSettings(incident=REHEARSAL_INCIDENT, fusion=fusion)
        load_scenario(scenario)
        agents = Agents(method, imu, odometry)
        rehearse_scenario(scenario, seed, settings, output, agents, replace=replace)
    except (ValueError, RecorderError, OSError) as error:
        _log.error(str(error))
        return ExitCode.USAGE
    except RehearsalError as error:
        _log.error(str(error))
        return ExitCode.FAILURE
    return ExitCode.OK


def montecarlo(
    *,
    scenario: list[str],
    runs: Positive = 20,
    seed: Seed = 0,
    particles: int = 1000,
    method: str | None = None,
    odometry: OdometrySource = "imu",
    workers: Positive = 2,
    json: bool = False,
) -> int:
    """Rehearse scenarios many times and score all runs together.

    Example: command-post montecarlo --scenario four_daps --runs 50

    Parameters
    ----------
    scenario
        A packaged scenario's name, or a TOML file; may be given several times.
    runs
        Of each scenario.
    seed
        Of the first run; each next one's is one higher.
    particles
        For each responder.
    method
        How the agents read their boots: eskf or linear; the agents' own default if not given.
    odometry
        Simulate the boots' sensors and read them (imu), or only the errors of strides (strides).
    workers
        Processes that share the work.
    json
        Print the score card as one JSON object.

    """
    errors: dict[str, list[RunErrors]] = {}
    console = Console(stderr=True)
    try:
        fusion = checked(FusionSettings(seed=seed, particles=particles))
        settings = IncidentSettings(incident=REHEARSAL_INCIDENT, fusion=fusion)
        agents = Agents(method, raw=False, odometry=odometry)
        for name in scenario:
            load_scenario(name)
        with Progress(console=console, transient=True, disable=not console.is_terminal) as bar:
            for name in scenario:
                task = bar.add_task(name, total=runs)
                errors[Path(name).stem] = []
                for chunk in run_many(name, runs, seed, settings, agents, workers):
                    errors[Path(name).stem].extend(chunk)
                    bar.advance(task, len(chunk))
    except ValueError as error:
        _log.error(str(error))
        return ExitCode.USAGE
    except RehearsalError as error:
        _log.error(str(error))
        return ExitCode.FAILURE
    card = pool(errors)
    if json:
        sys.stdout.buffer.write(msgspec.json.format(msgspec.json.encode(card)) + b"\n")
    else:
        for name, scored in card.scenarios.items():
            Console().print(pooled_table(name, scored))
    return ExitCode.OK
