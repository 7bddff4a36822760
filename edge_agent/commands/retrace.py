"""``edge-agent retrace``: follow recordings whose truth is known, offline."""

from __future__ import annotations

import heapq
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

import structlog
from cyclopts import Parameter

from edge_agent.agent import Agent
from edge_agent.evaluation.truth import Truth
from edge_agent.mounts.methods import MethodName, default_method, make_mount
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
    method: MethodName | None = None,
    with_parent: Annotated[bool, Parameter(show=False)] = False,
) -> int:
    """Follow recordings offline, and write what their wearers' units would have published.

    Leaves a wire log for each recording that has true stances, OUTPUT/FOLDER-NAME.wire, with the
    truth at each of them, in the frame of the recording. Example: edge-agent retrace
    ../shared/data/foot_strides --output logs

    Parameters
    ----------
    paths
        Recordings (.npz), and folders of them.
    output
        Folder for the logs.
    method
        How the boot's sensor is read: eskf, the default, or linear.
    with_parent
        End when standard input closes.

    """
    if with_parent:
        end_with_parent()
    method = method or default_method("boot")
    try:
        output.mkdir(parents=True, exist_ok=True)
        for trial in (trial for where in paths for trial in find_trials(where, seed=0)):
            _retrace(trial, method, output)
    except (ConfigError, SourceError, ValueError, OSError) as error:
        _log.error(str(error))
        return ExitCode.USAGE
    return ExitCode.OK


def _retrace(trial: Trial, method: MethodName, folder: Path) -> None:
    samples, truth = trial.load()
    if not isinstance(truth, Truth):
        _log.warning("has no true stances, and is left out", trial=trial.name)
        return
    first = samples.sample(0)
    source = Source(_readings(iter(samples), truth), first.time_ns, None)
    clock = ManualClock(REHEARSAL_START_NS)
    path = folder / f"{trial.group}-{trial.name}.wire".replace("/", "_")
    with WireLogBus(path, clock) as bus:
        sender = Sender(bus, REHEARSAL_INCIDENT, "responder", RESPONDER)
        agent = Agent(sender, make_mount("boot", method), method, None, sends_imu=False)
        for reading in source.beginning_at(REHEARSAL_START_NS):
            clock.set_ns(reading.time_ns)
            agent.take(reading)
        agent.finish()


def _readings(samples: Iterator[ImuSample], truth: Truth) -> Iterator[Reading]:
    """Yield samples and true stances by time; heights, which not every truth has, are nought."""
    places = (
        TruePlace(round(time_s * NS_PER_S), (north_m, east_m, 0.0))
        for time_s, (north_m, east_m) in zip(
            truth.time_s.tolist(), truth.position_m.tolist(), strict=True
        )
    )
    return heapq.merge(samples, places, key=lambda reading: reading.time_ns)
