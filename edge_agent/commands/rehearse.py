"""``edge-agent rehearse``: follow the responders of a scenario, offline."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import structlog
from cyclopts import Parameter
from rich.console import Console
from rich.progress import track

from edge_agent.agent import Agent
from edge_agent.commands.strides import rehearse_strides
from edge_agent.mounts.methods import MethodName, default_method, make_mount
from edge_agent.sources.opening import open_source
from edge_agent.sources.reading import Source
from edge_agent.sources.recording import SourceError
from shared.bus.wire_log import WireLogBus
from shared.clock import ManualClock
from shared.config import ConfigError
from shared.exercise import REHEARSAL_INCIDENT, REHEARSAL_START_NS, seeds_in
from shared.messages import NodeId
from shared.process import ExitCode, end_with_parent
from shared.sender import Sender
from shared.simulation.odometry_errors import OdometrySource
from shared.simulation.scenario import load_scenario

_log = structlog.stdlib.get_logger(__name__)


def rehearse(
    scenario: str,
    *,
    seeds: str = "1",
    method: MethodName | None = None,
    odometry: OdometrySource | None = None,
    output: Path,
    imu: bool = True,
    with_parent: Annotated[bool, Parameter(show=False)] = False,
) -> int:
    """Follow all responders of a scenario offline, and write what they would have published.

    Leaves a wire log for each responder, OUTPUT/SEED/RESPONDER.wire. Example: edge-agent rehearse
    four_daps --seeds 0-9 --output logs

    Parameters
    ----------
    scenario
        A packaged scenario's name, or a TOML file.
    seeds
        One seed, or the first and the last: 0-9.
    method
        How the boot's sensor is read: eskf, the default, or linear.
    odometry
        Simulate the boots' sensors and read them (imu), or only the errors of strides (strides);
        as the scenario says if not given.
    output
        Folder for the logs.
    imu
        Publish the raw samples as well, for the record.
    with_parent
        End when standard input closes.

    """
    if with_parent:
        end_with_parent()
    method = method or default_method("boot")
    try:
        exercise = load_scenario(scenario)
        jobs = [(seed, one) for seed in seeds_in(seeds) for one in exercise.responders]
        console = Console(stderr=True)
        for seed, responder_id in track(
            jobs, "rehearsing", console=console, transient=True, disable=not console.is_terminal
        ):
            if (odometry or exercise.odometry.source) == "strides":
                rehearse_strides(exercise, responder_id, seed, output / str(seed))
                continue
            source = open_source(f"simulated:{scenario}", responder_id, seed)
            _rehearse(source, responder_id, method, output / str(seed), sends_imu=imu)
    except (ConfigError, SourceError, ValueError, OSError) as error:
        _log.error(str(error))
        return ExitCode.USAGE
    return ExitCode.OK


def _rehearse(
    source: Source, responder_id: NodeId, method: MethodName, folder: Path, *, sends_imu: bool
) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    clock = ManualClock(REHEARSAL_START_NS)
    with WireLogBus(folder / f"{responder_id}.wire", clock) as bus:
        sender = Sender(bus, REHEARSAL_INCIDENT, "responder", responder_id)
        mount = make_mount("boot", method)
        agent = Agent(sender, mount, method, source.start, sends_imu=sends_imu)
        for reading in source.beginning_at(REHEARSAL_START_NS):
            clock.set_ns(reading.time_ns)
            agent.take(reading)
        agent.finish()
