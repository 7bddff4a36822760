"""``command-post proof``: the fusion on recordings of real boots and real radio."""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated

import msgspec
import structlog
from cyclopts import App, Parameter, validators
from rich.console import Console
from rich.table import Table

from command_post.evaluation.score_card import Radii
from command_post.fusion.settings import FusionMethod, FusionSettings
from command_post.fusion.team.settings import TeamSettings
from command_post.incident import IncidentSettings
from command_post.proof.boots import boot_trial, retrace
from command_post.proof.radio import radio_trial, recordings_at
from command_post.proof.trial import (
    Outcome,
    ProofScore,
    Trial,
    summed_up,
    trial_settings,
    try_out,
)
from command_post.rehearsing.rehearsal import RehearsalError
from shared.messages import Mount
from shared.node_options import Runs, Seed
from shared.process import ExitCode
from shared.walk_by import calibration_db, read_walk_by

HeadingSd = Annotated[float, Parameter(validator=validators.Number(gt=0.0, lte=180.0))]
Spacing = Annotated[float, Parameter(validator=validators.Number(gte=1.0, lte=1000.0))]

_log = structlog.stdlib.get_logger(__name__)

proof = App(name="proof", help="Hold the fusion against recordings of real boots and real radio.")


@proof.command
def boots(
    paths: list[str],
    /,
    *,
    spacing: Spacing = 30.0,
    heading_sd: HeadingSd = 30.0,
    seed: Seed = 0,
    runs: Runs = 1,
    mount: Mount = "boot",
    method: str | None = None,
    equal_steps: bool = False,
    fusion: FusionMethod = "team",
    axis: bool = True,
    json: bool = False,
) -> int:
    """Fuse real boots' strides with simulated DAPs, whose places are known, along the true ways.

    Errors are taken at the true stances. Example: command-post proof boots
    ../shared/data/foot_strides --heading-sd 180

    Parameters
    ----------
    paths
        Recordings with true stances or places (.npz), and folders of them.
    spacing
        A DAP for every so many metres of the way.
    heading_sd
        How well units know their heading at first, in degrees; 180 is not at all.
    seed
        Of what chance decides in the first run: DAPs, radio, headings.
    runs
        Of each recording; each next one's seed is one higher.
    mount
        How the sensors were worn.
    method
        How the agents read them; the agents' own default for the mount if not given.
    equal_steps
        Take a waist's steps to be of equal length, instead of its place to be between its feet.
    fusion
        How tracks are made.
    axis
        Let the team's fusion hold ways to an axis of the building where they show one.
    json
        Print the scores as one JSON object.

    """
    try:
        with tempfile.TemporaryDirectory(prefix="clew-proof-") as folder:
            logs = retrace(paths, mount, method, Path(folder), equal_steps=equal_steps)
    except (RehearsalError, OSError) as error:
        _log.error(str(error))
        return ExitCode.FAILURE
    if not logs:
        _log.error("no recording with true stances or places; give one")
        return ExitCode.USAGE
    trials = (
        boot_trial(log, spacing, heading_sd, each)
        for log in logs
        for each in range(seed, seed + runs)
    )
    _show(_tried(trials, fusion, axis=axis), json=json)
    return ExitCode.OK


@proof.command
def radio(
    paths: list[str],
    /,
    *,
    heading_sd: HeadingSd = 30.0,
    seed: Seed = 0,
    runs: Runs = 1,
    fusion: FusionMethod = "team",
    axis: bool = True,
    json: bool = False,
) -> int:
    """Fuse real readings of a carried beacon with a simulated boot on its true way.

    Errors are taken at every second. Example: command-post proof radio
    ../shared/data/rssi_walkby --runs 5

    Parameters
    ----------
    paths
        Recordings of a beacon carried past receivers (.npz), and folders of them.
    heading_sd
        How well units know their heading at first, in degrees; 180 is not at all.
    seed
        Of the boots' errors in the first run.
    runs
        Of each recording; each next one's seed is one higher.
    fusion
        How tracks are made.
    axis
        Let the team's fusion hold ways to an axis of the building where they show one.
    json
        Print the scores as one JSON object.

    """
    try:
        files = recordings_at(paths)
        recordings = [read_walk_by(file) for file in files]
        offset_db = calibration_db(recordings)
    except ValueError as error:
        _log.error(str(error))
        return ExitCode.USAGE
    trials = (
        radio_trial(file.stem, recording, offset_db, heading_sd, each)
        for file, recording in zip(files, recordings, strict=True)
        for each in range(seed, seed + runs)
    )
    _show(_tried(trials, fusion, axis=axis), json=json)
    return ExitCode.OK


def _tried(
    trials: Iterable[Trial], fusion: FusionMethod, *, axis: bool
) -> dict[str, list[Outcome]]:
    told = FusionSettings(method=fusion, team=TeamSettings(axis=axis))
    settings = trial_settings(IncidentSettings(fusion=told))
    outcomes: dict[str, list[Outcome]] = {}
    for trial in trials:
        outcomes.setdefault(trial.name, []).append(try_out(trial, settings))
    return outcomes


def _show(outcomes: dict[str, list[Outcome]], *, json: bool) -> None:
    every = summed_up([each for several in outcomes.values() for each in several])
    scores = {name: summed_up(several) for name, several in outcomes.items()}
    if json:
        told = {"all": every, "trials": scores}
        sys.stdout.buffer.write(msgspec.json.format(msgspec.json.encode(told)) + b"\n")
        return
    table = Table("", "runs", "live, CE50 / CE95", "in 95 %", "afterwards", "in 95 %")
    for name, score in scores.items():
        table.add_row(name, *_cells(score))
    table.add_section()
    table.add_row("all", *_cells(every))
    Console().print(table)


def _cells(score: ProofScore) -> tuple[str, ...]:
    return (
        f"{score.trials}",
        _radii(score.live),
        f"{score.live_coverage95_pct:.0f} %",
        _radii(score.after),
        f"{score.after_coverage95_pct:.0f} %",
    )


def _radii(told: Radii | None) -> str:
    return "none" if told is None else f"{told.ce50_m:.2f} / {told.ce95_m:.2f} m"
