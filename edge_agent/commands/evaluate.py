"""``edge-agent evaluate``: the score card of a mount over recordings with truth."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import msgspec
import structlog
from cyclopts import Parameter, validators

from edge_agent.commands.prepare import StepScale, Wheelbase
from edge_agent.commands.score_tables import print_degraded, print_tables
from edge_agent.commands.trial_scoring import Scored, Setup, score_all
from edge_agent.evaluation.degradation import degradations
from edge_agent.evaluation.score_card import ScoreCard
from edge_agent.mounts.methods import (
    STEPPING,
    MethodName,
    MountName,
    Told,
    default_method,
)
from edge_agent.mounts.vehicle import WHEELBASE_M
from edge_agent.sources.trials import find_trials
from shared.maths.statistics import Summary
from shared.node_options import Seed
from shared.process import ExitCode

_log = structlog.stdlib.get_logger(__name__)


DEGRADED_EVERY = 25
"""Of a vehicle's trials, the fixed one first."""


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
    seed: Seed = 0,
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
            Setup(mount, one, told, paced, seed, tried, plot) for one in _methods(mount, method)
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
    scored = [score_all(trials, setup) for setup in setups]
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


def _as_json(first: Scored, published: Scored | None = None) -> str:
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
