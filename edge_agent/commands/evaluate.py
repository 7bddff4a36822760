"""``edge-agent evaluate``: the score card of a mount over recordings with truth."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Annotated

import msgspec
import structlog
from cyclopts import Parameter
from rich.console import Console
from rich.progress import Progress

from edge_agent.commands.score_tables import print_tables
from edge_agent.evaluation.score_card import (
    ScoreCard,
    TrialScore,
    failed_trial,
    score_card,
    score_trial,
)
from edge_agent.mounts.interface import Increment
from edge_agent.mounts.methods import MethodName, MountName, make_mount
from edge_agent.sources.recording import SourceError
from edge_agent.sources.trials import Trial, TrialData, find_trials
from shared.config import ConfigError
from shared.maths.statistics import Summary
from shared.process import ExitCode

_log = structlog.stdlib.get_logger(__name__)

SAMPLES_A_TICK = 2000


def evaluate(
    paths: list[str],
    /,
    *,
    mount: MountName = "boot",
    method: MethodName = "linear",
    seed: int = 0,
    json: Annotated[bool, Parameter(negative="")] = False,
) -> int:
    """Score a mount's method on recordings whose truth is known, trial by trial and set by set.

    Errors are taken at the instants of the true stances, after one rigid alignment in the plane.
    A recording without truth that ends where it began is scored by its closure. A trial that
    fails is listed and counted. Exits with 2 if there is nothing to score or a file cannot be
    used, with 1 if a trial broke the mount.

    Parameters
    ----------
    paths
        Recordings (.npz, .csv), folders of them, and simulated:SCENARIO.
    mount
        How the sensor is worn.
    method
        How the mount reads it.
    seed
        Of the simulated scenarios' walks and sensors.
    json
        Print the score card as one JSON object.

    """
    try:
        trials = [trial for where in paths for trial in find_trials(where, seed)]
    except (SourceError, ConfigError) as error:
        _log.error(str(error))
        return ExitCode.USAGE
    scored = list(_score(trials, mount, method))
    card = score_card(row for row, _ in scored)
    if json:
        print(_as_json(card))  # noqa: T201
    else:
        print_tables(card, f"{mount}, {method}")
    return max(code for _, code in scored)


def _as_json(card: ScoreCard) -> str:
    sets = {
        name: {
            what: value._asdict() if isinstance(value, Summary) else value
            for what, value in summaries.items()
        }
        for name, summaries in card.sets.items()
    }
    return msgspec.json.format(msgspec.json.encode({"trials": card.trials, "sets": sets})).decode()


def _score(
    trials: Sequence[Trial], mount: MountName, method: MethodName
) -> Iterator[tuple[TrialScore, ExitCode]]:
    console = Console(stderr=True)
    with Progress(console=console, transient=True, disable=not console.is_terminal) as progress:
        overall = progress.add_task("trials", total=len(trials))
        for trial in trials:
            progress.update(overall, description=f"{trial.group} {trial.name}")
            yield _score_one(trial, mount, method, progress)
            progress.advance(overall)


def _score_one(
    trial: Trial, mount: MountName, method: MethodName, progress: Progress
) -> tuple[TrialScore, ExitCode]:
    """Return a trial's row, whatever happens, and what the exit code must be at least."""
    try:
        data = trial.load()
    except SourceError as error:
        _log.error(str(error))
        return failed_trial(trial.name, trial.group, None, str(error)), ExitCode.USAGE
    try:
        increments = _follow(data, mount, method, progress)
    except Exception as error:  # a trial that breaks the mount is a row of the card as well
        _log.exception("the mount failed", trial=trial.name)
        failure = f"{type(error).__name__}: {error}"
        return failed_trial(trial.name, trial.group, data.truth, failure), ExitCode.FAILURE
    return score_trial(trial.name, trial.group, increments, data.truth), ExitCode.OK


def _follow(
    data: TrialData, mount: MountName, method: MethodName, progress: Progress
) -> list[Increment]:
    worn = make_mount(mount, method)
    task = progress.add_task("samples", total=data.sample_count)
    increments = []
    for number, sample in enumerate(data.samples):
        increment = worn.step(sample)
        if increment is not None:
            increments.append(increment)
        if number % SAMPLES_A_TICK == 0:
            progress.update(task, completed=number)
    progress.remove_task(task)
    return increments + worn.finish()
