"""``edge-agent evaluate``: the score card of a mount over recordings with truth."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from time import process_time
from typing import Annotated, NamedTuple

import msgspec
import structlog
from cyclopts import Parameter, validators
from rich.console import Console
from rich.progress import Progress

from edge_agent.commands.drive_picture import draw_drive
from edge_agent.commands.prepare import StepScale, Wheelbase
from edge_agent.commands.score_tables import print_degraded, print_tables
from edge_agent.commands.track_picture import draw_trial
from edge_agent.evaluation.course_truth import (
    DrivenSpeed,
    FixedDrive,
    MountedDrive,
    MountTruth,
    Waypoints,
)
from edge_agent.evaluation.degradation import Degradation, degradations
from edge_agent.evaluation.estimate import estimated_path
from edge_agent.evaluation.pace import scale_over
from edge_agent.evaluation.score_card import ScoreCard, TrialScore, failed_trial, score_card
from edge_agent.evaluation.scorers import SCORERS
from edge_agent.evaluation.vehicle_score import Drive, follow_drive, score_drive
from edge_agent.mounts.interface import Increment, Mount
from edge_agent.mounts.methods import (
    STEPPING,
    MethodName,
    MountName,
    Told,
    default_method,
    make_mount,
)
from edge_agent.mounts.vehicle import WHEELBASE_M, VehicleMount
from edge_agent.mounts.vehicle_published import PublishedVehicleMount
from edge_agent.sources.recording import Recording, SourceError
from edge_agent.sources.trials import Trial, TrialData, find_trials
from shared.maths.statistics import Summary
from shared.process import ExitCode
from shared.simulation.chance import generator

_log = structlog.stdlib.get_logger(__name__)


DEGRADED_EVERY = 25
"""Of a vehicle's trials, the fixed one first."""


class _Setup(NamedTuple):
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
        building = ", dominant direction" * self.told.dominant_direction
        return f"{self.mount}, {self.method}{building}"

    def new_mount(self) -> Mount:
        return make_mount(self.mount, self.method, self.told)

    def score(
        self, trial: Trial, increments: Sequence[Increment], truth: MountTruth | None
    ) -> TrialScore:
        return SCORERS[self.mount](trial.name, trial.group, increments, truth)


class _Outcome(NamedTuple):
    """A trial's row, its row by degradation, and what the exit code must be at least."""

    row: TrialScore
    degraded: dict[str, TrialScore]
    code: ExitCode


class _Scored(NamedTuple):
    """A method's score card, its cards by degradation, and the exit code it asks for."""

    card: ScoreCard
    degraded: dict[str, ScoreCard]
    code: ExitCode


def evaluate(
    paths: list[str],
    /,
    *,
    mount: MountName = "boot",
    method: MethodName | None = None,
    dominant_direction: Annotated[bool, Parameter(negative="")] = False,
    wheelbase: Wheelbase = WHEELBASE_M,
    step_scale: StepScale = 1.0,
    paced: Annotated[float | None, Parameter(validator=validators.Number(gte=5.0))] = None,
    seed: Annotated[int, Parameter(validator=validators.Number(gte=0))] = 0,
    degrade: Annotated[bool, Parameter(negative="")] = False,
    plot: Path | None = None,
    json: Annotated[bool, Parameter(negative="")] = False,
) -> int:
    """Score a mount's method on recordings whose truth is known, trial by trial and set by set.

    A boot's errors are taken at the instants of the true stances, after one rigid alignment in the
    plane. A recording without truth that ends where it began is scored by its closure. Of the
    other mounts the published method is scored beside the default. A vehicle's drive is scored as
    recorded and with its phone lying and slipping in fifty ways; its first speed is told. A trial
    that fails is listed and counted. Examples: edge-agent evaluate simulated:course --json;
    edge-agent evaluate --mount chest ../shared/data/phone_waypoints

    Exits with 2 if there is nothing to score, with 1 if a file cannot be used or a trial could not
    be scored; the others are.

    Parameters
    ----------
    paths
        Recordings (.npz, .csv), folders of them, a phone's export, and simulated:SCENARIO.
    mount
        How the sensor is worn.
    method
        How the mount reads it: eskf or linear for a boot, robust or published for the others. The
        first is the default; the others are then read as published, too.
    dominant_direction
        Hold the heading to where the building's corridors lead, which is learnt on the way.
    wheelbase
        Metres between a vehicle's axles.
    step_scale
        How long a wearer's steps are, in those of nobody in particular.
    paced
        Let each wearer's scale be known as so many metres at the start tell it, where there are
        way-points: a chest or a waist is then followed with that scale from the beginning.
    seed
        Of the simulated scenarios' walks and sensors, and of what a degradation leaves to chance.
    degrade
        Score every trial again from a worse sensor, one fault at a time: lower rates and ranges,
        bias, scale, noise, lost samples, gaps, a boot's clock, axes turned or stuck. Of a vehicle's
        mountings every 25th is.
    plot
        Folder for a picture of each trial: track beside truth, and each stride's error.
    json
        Print the score card as one JSON object.

    """
    tried = degradations(mount) if degrade else {}
    try:
        if paced is not None and mount not in STEPPING:
            raise ValueError(f"--paced: only of a chest or a waist, not of a {mount}")
        told = Told(dominant_direction, wheelbase, step_scale)
        setups = [
            _Setup(mount, one, told, paced, seed, tried, plot) for one in _methods(mount, method)
        ]
        for setup in setups:
            setup.new_mount()
        trials = [trial for where in paths for trial in find_trials(where, seed, mount)]
        if degrade and mount == "vehicle":
            trials = trials[::DEGRADED_EVERY]
        if plot is not None:
            plot.mkdir(parents=True, exist_ok=True)
    except (ValueError, OSError) as error:
        _log.error(str(error))
        return ExitCode.USAGE
    scored = [_score_all(trials, setup) for setup in setups]
    if json:
        print(_as_json(*scored))  # noqa: T201
    else:
        for setup, (card, degraded, _) in zip(setups, scored, strict=True):
            print_tables(card, setup.title)
            if degraded:
                print_degraded({"as recorded": card, **degraded}, setup.title, mount)
    return max(one.code for one in scored)


def _methods(mount: MountName, method: MethodName | None) -> list[MethodName]:
    """Return the methods to score: the one asked for, else the default and what it came from."""
    if method is not None:
        return [method]
    default = default_method(mount)
    return [default] if mount == "boot" or default == "published" else [default, "published"]


def _score_all(trials: Sequence[Trial], setup: _Setup) -> _Scored:
    outcomes = list(_score(trials, setup))
    degraded = {
        name: score_card(outcome.degraded[name] for outcome in outcomes)
        for name in setup.degradations
    }
    card = score_card(outcome.row for outcome in outcomes)
    return _Scored(card, degraded, max(outcome.code for outcome in outcomes))


def _as_json(first: _Scored, published: _Scored | None = None) -> str:
    told: dict[str, object] = {"trials": first.card.trials, "sets": _plain(first.card)}
    if first.degraded:
        told["degraded"] = {name: _plain(worse) for name, worse in first.degraded.items()}
    if published is not None:
        told["published"] = {"trials": published.card.trials, "sets": _plain(published.card)}
    return msgspec.json.format(msgspec.json.encode(told)).decode()


def _plain(card: ScoreCard) -> dict[str, dict[str, object]]:
    return {
        name: {
            what: value._asdict() if isinstance(value, Summary) else value
            for what, value in summaries.items()
        }
        for name, summaries in card.sets.items()
    }


def _score(trials: Sequence[Trial], setup: _Setup) -> Iterator[_Outcome]:
    console = Console(stderr=True)
    with Progress(console=console, transient=True, disable=not console.is_terminal) as progress:
        overall = progress.add_task("trials", total=len(trials))
        for trial in trials:
            progress.update(overall, description=f"{trial.group} {trial.name}")
            yield _score_one(trial, setup)
            progress.advance(overall)


def _score_one(trial: Trial, setup: _Setup) -> _Outcome:
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


def _score_each_way(trial: Trial, setup: _Setup) -> _Outcome:
    """Score a trial as it was recorded, and with each degradation."""
    data = trial.load()
    row, code = _score_data(trial, data, setup, setup.plot)
    degraded = {}
    for name, degradation in setup.degradations.items():
        chance = generator(setup.seed, "degradation", name, trial.group, trial.name)
        try:
            worse = TrialData(*degradation.apply(data.samples, data.truth, chance))
            if isinstance(data.truth, MountedDrive):
                # The phone that is fixed loses the same samples.
                again = generator(setup.seed, "degradation", name, trial.group, trial.name)
                samples = degradation.degrade(data.truth.fixed.samples, again)
                fixed = replace(data.truth.fixed, samples=samples)
                worse = worse._replace(truth=replace(data.truth, fixed=fixed))
        except ValueError as error:
            degraded[name] = failed_trial(trial.name, trial.group, data.truth, str(error))
            continue
        worse_row, worse_code = _score_data(trial, worse, setup, None)
        # Sets go by the true speed, which a wrong clock changes.
        degraded[name] = msgspec.structs.replace(worse_row, set=row.set)
        code = max(code, worse_code)
    return _Outcome(row, degraded, code)


def _score_data(
    trial: Trial, data: TrialData, setup: _Setup, plot: Path | None
) -> tuple[TrialScore, ExitCode]:
    if isinstance(data.truth, MountedDrive):
        return _score_drive(trial, data.samples, data.truth, setup)
    try:
        increments, elapsed_s = _follow(data, setup)
        row = setup.score(trial, increments, data.truth)
    except Exception as error:  # a trial that breaks the mount is a row of the card as well
        _log.exception("the mount or its score failed", trial=trial.name)
        failure = f"{type(error).__name__}: {error}"
        return failed_trial(trial.name, trial.group, data.truth, failure), ExitCode.FAILURE
    if plot is not None and row.failure is None:
        file = plot / f"{row.set}_{row.name}.png".replace("/", "_")
        title = f"{row.set} {row.name} ({setup.title})"
        draw_trial(estimated_path(increments), data.truth, title, file)
    samples_per_s = len(data.samples) / elapsed_s
    return msgspec.structs.replace(row, samples_per_s=samples_per_s), ExitCode.OK


def _score_drive(
    trial: Trial, samples: Recording, truth: MountedDrive, setup: _Setup
) -> tuple[TrialScore, ExitCode]:
    try:
        began_s = process_time()
        drive = _drive(setup.method, setup.told, samples, truth.fixed.speed)
        samples_per_s = len(samples) / (process_time() - began_s)
        fixed = None
        if truth.slips:
            fixed = _fixed_drive(setup.method, setup.told, truth.fixed)
        row = score_drive(trial.name, trial.group, drive, fixed, truth)
    except Exception as error:  # a trial that breaks the mount is a row of the card as well
        _log.exception("the mount or its score failed", trial=trial.name)
        failure = f"{type(error).__name__}: {error}"
        return failed_trial(trial.name, trial.group, truth, failure), ExitCode.FAILURE
    if setup.plot is not None:
        file = setup.plot / f"{row.set}_{row.name}_{setup.method}.png".replace("/", "_")
        draw_drive(drive, fixed, truth, f"{row.set} {row.name} ({setup.title})", file)
    return msgspec.structs.replace(row, samples_per_s=samples_per_s), ExitCode.OK


@lru_cache(maxsize=4)
def _fixed_drive(method: MethodName, told: Told, fixed: FixedDrive) -> Drive:
    """Return what ``method`` makes of the phone as it was fixed."""
    return _drive(method, told, fixed.samples, fixed.speed)


def _drive(method: MethodName, told: Told, samples: Recording, speed: DrivenSpeed) -> Drive:
    mount = make_mount("vehicle", method, told)
    assert isinstance(mount, VehicleMount | PublishedVehicleMount)  # noqa: S101
    return follow_drive(mount, samples, speed)


def _follow(data: TrialData, setup: _Setup) -> tuple[list[Increment], float]:
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
