"""``command-post rehearse`` and ``command-post montecarlo``: exercises without a network."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import msgspec
import numpy as np
import structlog
from cyclopts import Parameter, validators
from rich.console import Console
from rich.progress import Progress

from command_post.evaluation.naming import Naming, Trial, naming
from command_post.evaluation.pooled import PooledScore, latency, pool, told_of
from command_post.fusion.settings import FusionMethod, FusionSettings
from command_post.fusion.team.settings import TeamSettings
from command_post.fusion.walls import Wall
from command_post.incident import IncidentSettings
from command_post.plans.plan_file import geojson_of, with_plan
from command_post.recorder.file import RecorderError
from command_post.rehearsing.cluster import ClusterError
from command_post.rehearsing.monte_carlo import Exercise, Run, run_many, run_one
from command_post.rehearsing.rehearsal import Agents, BootMethod, RehearsalError
from command_post.rehearsing.rehearsal import rehearse as rehearse_scenario
from command_post.rehearsing.score_table import naming_table, pooled_table
from shared.config import ConfigError, checked
from shared.exercise import REHEARSAL_INCIDENT
from shared.files import check_can_write, replace_atomically
from shared.node_options import Runs, Seed
from shared.process import ExitCode
from shared.simulation.odometry_errors import OdometrySource
from shared.simulation.scenario import MISHAPS, load_scenario

Workers = Annotated[int, Parameter(validator=validators.Number(gt=0, lte=1024))]

_log = structlog.stdlib.get_logger(__name__)


def rehearse(
    scenario: str,
    *,
    output: Path,
    seed: Seed = 1,
    method: BootMethod | None = None,
    odometry: OdometrySource | None = None,
    fusion: FusionMethod = "team",
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
        Simulate the boots' sensors and read them (imu), or only the errors of strides (strides);
        as the scenario says if not given.
    fusion
        The whole team smoothed together (team), or a particle filter for each (published).
    imu
        Record the raw samples and readings as well.
    replace
        Replace a recording that is there already.

    """
    try:
        check_can_write(output, "--output")
        settings = _settings(FusionSettings(method=fusion, seed=seed))
        load_scenario(scenario)
        agents = Agents(method, imu, odometry)
        rehearse_scenario(scenario, seed, settings, output, agents, replace=replace)
    except (ValueError, RecorderError) as error:
        _log.error(str(error))
        return ExitCode.USAGE
    except OSError as error:
        _log.error(f"{error.filename or output}: cannot be written ({error.strerror})")
        return ExitCode.FAILURE
    except RehearsalError as error:
        _log.error(str(error))
        return ExitCode.FAILURE
    return ExitCode.OK


def montecarlo(
    *,
    scenario: list[str],
    runs: Runs = 20,
    seed: Seed = 0,
    particles: int = 1000,
    method: BootMethod | None = None,
    odometry: OdometrySource | None = None,
    fusion: FusionMethod = "team",
    plan: Path | None = None,
    axis: bool = True,
    workers: Workers = 2,
    dask: str | None = None,
    picture: Path | None = None,
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
        For each responder, of the published filter.
    method
        How the agents read their boots: eskf or linear; the agents' own default if not given.
    odometry
        Simulate the boots' sensors and read them (imu), or only the errors of strides (strides);
        as the scenario says if not given.
    fusion
        The whole team smoothed together (team), or a particle filter for each (published).
    plan
        The building's walls, in GeoJSON, as ``command-post plan`` writes a scenario's.
    axis
        Let the team's fusion hold ways to an axis of the building where they show one.
    workers
        Processes that share the work.
    dask
        Address of a Dask cluster's scheduler: its machines do the work instead.
    picture
        Draw how errors are distributed, and the tracks of the first run, into this PNG.
    json
        Print the score card as one JSON object.

    """
    agents = Agents(method, raw=False, odometry=odometry)
    try:
        check_can_write(picture, "--picture")
        told = FusionSettings(
            method=fusion, team=TeamSettings(axis=axis), seed=seed, particles=particles
        )
        settings = with_plan(told, plan)
        exercises = _exercises(scenario, settings, agents)
        done = _run_all(exercises, runs, seed, workers, dask)
        # What took long is told before a picture can fail.
        _show(_card(done), json=json)
        if picture is not None:
            _draw(exercises, done, seed, picture)
    except (ValueError, RehearsalError, ClusterError, OSError) as error:
        _log.error(str(error))
        return ExitCode.USAGE if isinstance(error, ValueError) else ExitCode.FAILURE
    return ExitCode.OK


def mishaps(
    *,
    scenario: list[str],
    mishap: list[str] | None = None,
    runs: Runs = 2,
    seed: Seed = 0,
    workers: Workers = 2,
    json: bool = False,
) -> int:
    """Let one thing after another go wrong in scenarios, and say if it is named and whom it harms.

    Each is run beside the same seeds with all in order. Example: command-post mishaps
    --scenario three_floors --mishap moved_15m --mishap clock_behind

    Parameters
    ----------
    scenario
        A packaged scenario's name, or a TOML file; may be given several times.
    mishap
        A packaged mishap's name, or a TOML file; may be given several times. All packaged ones if
        not given.
    runs
        Of each scenario with each mishap.
    seed
        Of the first run; each next one's is one higher.
    workers
        Processes that share the work.
    json
        Print what came of it as one JSON object.

    """
    named = mishap or sorted(path.stem for path in MISHAPS.glob("*.toml"))
    agents = Agents(None, raw=False)
    try:
        # All are looked at before the first is run.
        tried = [
            _exercises([one, *(f"{one}+{each}" for each in named)], FusionSettings(), agents)
            for one in scenario
        ]
        told = {
            Path(one).stem: _namings(exercises, ["nothing", *named], runs, seed, workers)
            for one, exercises in zip(scenario, tried, strict=True)
        }
    except (ValueError, RehearsalError, OSError) as error:
        _log.error(str(error))
        return ExitCode.USAGE if isinstance(error, ValueError) else ExitCode.FAILURE
    if json:
        sys.stdout.buffer.write(msgspec.json.format(msgspec.json.encode(told)) + b"\n")
    else:
        for name, namings in told.items():
            Console().print(naming_table(name, namings))
    return ExitCode.OK


def _namings(
    exercises: dict[str, Exercise], mishaps: list[str], runs: int, first_seed: int, workers: int
) -> dict[str, Naming]:
    """Run exercises, the first of which is the others with all in order."""
    done = list(_run_all(exercises, runs, first_seed, workers, None).values())
    return {
        mishap: naming(
            load_scenario(exercise.scenario_name),
            [Trial(run.errors, beside.errors, run.told_s)
             for run, beside in zip(wrong, done[0], strict=True)],
        )
        for mishap, exercise, wrong in zip(mishaps, exercises.values(), done, strict=True)
    }  # fmt: skip


def plan(scenario: str, *, output: Path) -> int:
    """Write the walls of a scenario's building as GeoJSON, in the incident's frame.

    Example: command-post plan offices --output offices.geojson

    Parameters
    ----------
    scenario
        A packaged scenario's name, or a TOML file.
    output
        Where the plan goes.

    """
    try:
        check_can_write(output, "--output")
        pieces_m = load_scenario(scenario).building.wall_pieces_m.tolist()
        walls = tuple(
            Wall(from_north_m, from_east_m, to_north_m, to_east_m)
            for (from_north_m, from_east_m), (to_north_m, to_east_m) in pieces_m
        )
        with replace_atomically(output) as file:
            file.write(geojson_of(walls))
    except (ValueError, OSError) as error:
        _log.error(str(error))
        return ExitCode.USAGE
    return ExitCode.OK


def _exercises(scenarios: list[str], fusion: FusionSettings, agents: Agents) -> dict[str, Exercise]:
    """Return what is to be run by its name, once it is sure that all scenarios can be used."""
    exercises: dict[str, Exercise] = {}
    for scenario in scenarios:
        load_scenario(scenario)
        name = "+".join(Path(part).stem for part in scenario.split("+"))
        if name in exercises:
            raise ConfigError(f"{scenario}: another scenario is called {name!r}; give it a name")
        exercises[name] = Exercise(scenario, _settings(fusion), agents)
    return exercises


def _settings(fusion: FusionSettings) -> IncidentSettings:
    return IncidentSettings(incident=REHEARSAL_INCIDENT, fusion=checked(fusion))


def _run_all(
    exercises: dict[str, Exercise], runs: int, first_seed: int, workers: int, address: str | None
) -> dict[str, list[Run]]:
    """Run every exercise, and show how far that is."""
    console = Console(stderr=True)
    done: dict[str, list[Run]] = {}
    with Progress(console=console, transient=True, disable=not console.is_terminal) as bar:
        for name, exercise in exercises.items():
            task = bar.add_task(name, total=runs)
            done[name] = []
            for chunk in run_many(exercise, runs, first_seed, workers, address):
                done[name].extend(chunk)
                bar.advance(task, len(chunk))
    return done


def _draw(
    exercises: dict[str, Exercise], done: dict[str, list[Run]], seed: int, picture: Path
) -> None:
    """Draw each scenario; its first run is made once more, for its tracks."""
    # Slow to load, and most want figures alone.
    from command_post.rehearsing.distribution_picture import (  # noqa: PLC0415
        Drawn,
        draw_monte_carlo,
    )

    drawn = []
    for name, exercise in exercises.items():
        plan = load_scenario(exercise.scenario_name).building
        errors = [run.errors for run in done[name]]
        drawn.append(Drawn(name, errors, run_one(exercise, seed).evidence, plan))
    draw_monte_carlo(drawn, picture)


def _card(done: dict[str, list[Run]]) -> PooledScore:
    card = pool({name: [run.errors for run in runs] for name, runs in done.items()})
    handled_ms = {
        name: np.concatenate([run.handled_ms for run in runs]) for name, runs in done.items()
    }
    return PooledScore(
        scenarios={
            name: msgspec.structs.replace(
                told,
                latency_ms=latency(handled_ms[name]),
                told=told_of([run.told_s for run in done[name]]),
            )
            for name, told in card.scenarios.items()
        }
    )


def _show(card: PooledScore, *, json: bool) -> None:
    if json:
        sys.stdout.buffer.write(msgspec.json.format(msgspec.json.encode(card)) + b"\n")
        return
    for name, scored in card.scenarios.items():
        Console().print(pooled_table(name, scored))
