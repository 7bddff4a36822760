"""``edge-agent retrace``: follow recordings whose truth is known, offline."""

from __future__ import annotations

import heapq
from collections.abc import Iterator
from itertools import chain
from pathlib import Path
from typing import Annotated

import structlog
from cyclopts import Parameter

from edge_agent.agent import Agent
from edge_agent.evaluation.course_truth import MountTruth, StepCount, Waypoints, out_and_back
from edge_agent.evaluation.truth import Truth
from edge_agent.mounts.methods import MethodName, MountName, default_method, make_mount
from edge_agent.sources.reading import Reading, Source, TruePlace
from edge_agent.sources.recording import SourceError
from edge_agent.sources.trials import Trial, find_trials
from shared.bus.wire_log import WireLogBus
from shared.clock import ManualClock
from shared.config import ConfigError
from shared.exercise import REHEARSAL_INCIDENT, REHEARSAL_START_NS
from shared.messages import ImuSample
from shared.process import ExitCode, end_with_parent
from shared.sender import Sender
from shared.units import NS_PER_S

RESPONDER = "r1"

_log = structlog.stdlib.get_logger(__name__)


def retrace(
    paths: list[str],
    /,
    *,
    output: Path,
    mount: MountName = "boot",
    method: MethodName | None = None,
    equal_steps: Annotated[bool, Parameter(negative="")] = False,
    with_parent: Annotated[bool, Parameter(show=False)] = False,
) -> int:
    """Follow recordings offline, and write what their wearers' units would have published.

    Leaves a wire log for each recording that has true stances or places, OUTPUT/FOLDER-NAME.wire,
    with the truth at each of them, in the frame of the recording. Example: edge-agent retrace
    ../shared/data/foot_strides --output logs

    Parameters
    ----------
    paths
        Recordings (.npz), and folders of them.
    output
        Folder for the logs.
    mount
        How the sensor is worn.
    method
        How the mount reads it; its own default if not given.
    equal_steps
        Take a waist's steps, out and back, to be of equal length, instead of its place to be
        between its feet as sensors on them tell.
    with_parent
        End when standard input closes.

    """
    if with_parent:
        end_with_parent()
    method = method or default_method(mount)
    try:
        output.mkdir(parents=True, exist_ok=True)
        found = (find_trials(where, 0, mount, by_feet=not equal_steps) for where in paths)
        for trial in chain.from_iterable(found):
            _retrace(trial, mount, method, output)
    except (ConfigError, SourceError, ValueError, OSError) as error:
        _log.error(str(error))
        return ExitCode.USAGE
    return ExitCode.OK


def _retrace(trial: Trial, mount: MountName, method: MethodName, folder: Path) -> None:
    samples, known = trial.load()
    truth = _places(known)
    if truth is None:
        _log.warning("has no true stances or places, and is left out", trial=trial.name)
        return
    first = samples.sample(0)
    source = Source(_readings(iter(samples), truth), first.time_ns, None)
    clock = ManualClock(REHEARSAL_START_NS)
    path = folder / f"{trial.group}-{trial.name}.wire".replace("/", "_")
    with WireLogBus(path, clock) as bus:
        sender = Sender(bus, REHEARSAL_INCIDENT, "responder", RESPONDER)
        agent = Agent(sender, make_mount(mount, method), method, None, worn=mount, sends_imu=False)
        for reading in source.beginning_at(REHEARSAL_START_NS):
            clock.set_ns(reading.time_ns)
            agent.take(reading)
        agent.finish()


def _places(truth: MountTruth | None) -> Truth | Waypoints | None:
    """Return where the wearer was, if it is known; half a course's steps lead out, half back."""
    if isinstance(truth, StepCount):
        return out_and_back(truth)
    return truth if isinstance(truth, Truth | Waypoints) else None


def _readings(samples: Iterator[ImuSample], truth: Truth | Waypoints) -> Iterator[Reading]:
    """Yield samples and true places by time; heights, which not every truth has, are nought."""
    places = (
        TruePlace(round(time_s * NS_PER_S), (north_m, east_m, 0.0))
        for time_s, (north_m, east_m) in zip(
            truth.time_s.tolist(), truth.position_m.tolist(), strict=True
        )
    )
    return heapq.merge(samples, places, key=lambda reading: reading.time_ns)
