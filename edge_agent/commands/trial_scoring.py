"""Scoring a mount's method trial by trial: whatever is wrong with one, the others are scored."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache, partial
from pathlib import Path
from time import process_time
from typing import NamedTuple

import msgspec
import numpy as np
import structlog
from rich.console import Console
from rich.progress import Progress

from edge_agent.commands.drive_picture import draw_drive
from edge_agent.commands.track_picture import draw_trial
from edge_agent.evaluation.course_truth import DrivenSpeed, FixedDrive, MountedDrive, Waypoints
from edge_agent.evaluation.degradation import Degradation
from edge_agent.evaluation.estimate import estimated_path
from edge_agent.evaluation.pace import scale_over
from edge_agent.evaluation.score_card import ScoreCard, TrialScore, failed_trial, score_card
from edge_agent.evaluation.scorers import SCORERS
from edge_agent.evaluation.vehicle_score import Drive, follow_drive, score_drive
from edge_agent.mounts.interface import Increment, Mount
from edge_agent.mounts.methods import MethodName, MountName, Told, make_mount
from edge_agent.mounts.vehicle import VehicleMount
from edge_agent.mounts.vehicle_published import PublishedVehicleMount
from edge_agent.sources.recording import Recording, SourceError
from edge_agent.sources.trials import Trial, TrialData
from shared.process import ExitCode
from shared.simulation.chance import generator

_log = structlog.stdlib.get_logger(__name__)


class Setup(NamedTuple):
    """What is scored, and how: the same for every trial."""

    mount: MountName
    method: MethodName
    told: Told
    paced_m: float | None
    seed: int
    degradations: Mapping[str, Degradation]
    plot: Path | None

    @property
    def title(self) -> str:
        """What it is called above a table or a picture."""
        building = ", dominant direction" * self.told.dominant_direction
        return f"{self.mount}, {self.method}{building}"

    def new_mount(self) -> Mount:
        """Return the mount as it is before any sample. Raises ``ValueError`` if there is none."""
        return make_mount(self.mount, self.method, self.told)


class Scored(NamedTuple):
    """A method's score card, its cards by degradation, and the exit code it asks for."""

    card: ScoreCard
    degraded: dict[str, ScoreCard]
    code: ExitCode


class _Outcome(NamedTuple):
    """A trial's row, its row by degradation, and what the exit code must be at least."""

    row: TrialScore
    degraded: dict[str, TrialScore]
    code: ExitCode


class _Try(NamedTuple):
    """What came of one way through a trial's samples, how long that took, and how to draw it."""

    row: TrialScore
    took_s: float
    draw: Callable[[str, Path], None]


def score_all(trials: Sequence[Trial], setup: Setup) -> Scored:
    """Score every trial, as it was recorded and with each degradation, and show how far that is."""
    outcomes = list(_shown(trials, setup))
    degraded = {
        name: score_card(outcome.degraded[name] for outcome in outcomes)
        for name in setup.degradations
    }
    card = score_card(outcome.row for outcome in outcomes)
    return Scored(card, degraded, max(outcome.code for outcome in outcomes))


def _shown(trials: Sequence[Trial], setup: Setup) -> Iterator[_Outcome]:
    console = Console(stderr=True)
    with Progress(console=console, transient=True, disable=not console.is_terminal) as progress:
        overall = progress.add_task("trials", total=len(trials))
        for trial in trials:
            progress.update(overall, description=f"{trial.group} {trial.name}")
            yield _score_one(trial, setup)
            progress.advance(overall)


def _score_one(trial: Trial, setup: Setup) -> _Outcome:
    """Return a trial's rows, whatever happens, and what the exit code must be at least."""
    try:
        return _score_each_way(trial, setup)
    except SourceError as error:
        _log.error(str(error))
        failure = str(error)
    except Exception as error:  # whatever is wrong with one trial, the others are scored
        _log.exception("the trial could not be scored", trial=trial.name)
        failure = f"{type(error).__name__}: {error}"
    row = failed_trial(trial.name, trial.group, None, failure)
    return _Outcome(row, dict.fromkeys(setup.degradations, row), ExitCode.FAILURE)


def _score_each_way(trial: Trial, setup: Setup) -> _Outcome:
    """Score a trial as it was recorded, and with each degradation."""
    data = trial.load()
    row, code = _score_data(trial, data, setup, setup.plot)
    degraded = {}
    for name, degradation in setup.degradations.items():
        chance = partial(generator, setup.seed, "degradation", name, trial.group, trial.name)
        try:
            worse = _worse(data, degradation, chance)
        except ValueError as error:
            degraded[name] = failed_trial(trial.name, trial.group, data.truth, str(error))
            continue
        worse_row, worse_code = _score_data(trial, worse, setup, None)
        # Sets go by the true speed, which a wrong clock changes.
        degraded[name] = msgspec.structs.replace(worse_row, set=row.set)
        code = max(code, worse_code)
    return _Outcome(row, degraded, code)


def _worse(
    data: TrialData, degradation: Degradation, chance: Callable[[], np.random.Generator]
) -> TrialData:
    """Return ``data`` as from a worse sensor. Raises ``ValueError`` where that cannot be had."""
    worse = TrialData(*degradation.apply(data.samples, data.truth, chance()))
    if not len(worse.samples):
        raise ValueError("too short: none of its samples is left")
    if not isinstance(data.truth, MountedDrive):
        return worse
    # The phone that is fixed loses the same samples.
    samples = degradation.degrade(data.truth.fixed.samples, chance())
    fixed = replace(data.truth.fixed, samples=samples)
    return worse._replace(truth=replace(data.truth, fixed=fixed))


def _score_data(
    trial: Trial, data: TrialData, setup: Setup, plot: Path | None
) -> tuple[TrialScore, ExitCode]:
    """Return the row of one way through a trial, drawn if there is a ``plot``, and its code."""
    try:
        if isinstance(data.truth, MountedDrive):
            tried = _try_drive(trial, data.samples, data.truth, setup)
        else:
            tried = _try_walk(trial, data, setup)
    except Exception as error:  # a trial that breaks the mount is a row of the card as well
        _log.exception("the mount or its score failed", trial=trial.name)
        failure = f"{type(error).__name__}: {error}"
        return failed_trial(trial.name, trial.group, data.truth, failure), ExitCode.FAILURE
    row = tried.row
    if plot is not None and row.failure is None:
        tried.draw(f"{row.set} {row.name} ({setup.title})", plot)
    samples_per_s = len(data.samples) / tried.took_s
    return msgspec.structs.replace(row, samples_per_s=samples_per_s), ExitCode.OK


def _try_walk(trial: Trial, data: TrialData, setup: Setup) -> _Try:
    increments, took_s = _follow(data, setup)
    row = SCORERS[setup.mount](trial.name, trial.group, increments, data.truth)

    def draw(title: str, folder: Path) -> None:
        file = _picture(folder, f"{row.set}_{row.name}")
        draw_trial(estimated_path(increments), data.truth, title, file)

    return _Try(row, took_s, draw)


def _try_drive(trial: Trial, samples: Recording, truth: MountedDrive, setup: Setup) -> _Try:
    began_s = process_time()
    drive = _drive(setup.method, setup.told, samples, truth.fixed.speed)
    took_s = process_time() - began_s
    fixed = _fixed_drive(setup.method, setup.told, truth.fixed) if truth.slips else None
    row = score_drive(trial.name, trial.group, drive, fixed, truth)

    def draw(title: str, folder: Path) -> None:
        file = _picture(folder, f"{row.set}_{row.name}_{setup.method}")
        draw_drive(drive, fixed, truth, title, file)

    return _Try(row, took_s, draw)


def _picture(folder: Path, name: str) -> Path:
    return folder / f"{name}.png".replace("/", "_")


@lru_cache(maxsize=4)
def _fixed_drive(method: MethodName, told: Told, fixed: FixedDrive) -> Drive:
    """Return what ``method`` makes of the phone as it was fixed."""
    return _drive(method, told, fixed.samples, fixed.speed)


def _drive(method: MethodName, told: Told, samples: Recording, speed: DrivenSpeed) -> Drive:
    mount = make_mount("vehicle", method, told)
    assert isinstance(mount, VehicleMount | PublishedVehicleMount)  # noqa: S101
    return follow_drive(mount, samples, speed)


def _follow(data: TrialData, setup: Setup) -> tuple[list[Increment], float]:
    """Return what a new mount makes of the samples, and the processor time of that alone (s)."""
    mount = setup.new_mount()
    began_s = process_time()
    increments = mount.steps(data.samples) + mount.finish()
    elapsed_s = process_time() - began_s
    if setup.paced_m is not None and isinstance(data.truth, Waypoints):
        scale = setup.told.step_scale * scale_over(
            increments, data.truth, setup.paced_m, "chest" if setup.mount == "chest" else "waist"
        )
        mount = make_mount(setup.mount, setup.method, setup.told._replace(step_scale=scale))
        increments = mount.steps(data.samples) + mount.finish()
    return increments, elapsed_s
