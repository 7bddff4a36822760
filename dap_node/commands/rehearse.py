"""``dap-node rehearse``: what the DAPs of a scenario would say, offline."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import structlog
from cyclopts import Parameter
from rich.console import Console
from rich.progress import track

from dap_node.node import DapNode
from dap_node.scanners.simulated import SimulatedScanner
from shared.bus.wire_log import WireLogBus
from shared.clock import ManualClock
from shared.exercise import REHEARSAL_INCIDENT, REHEARSAL_START_NS, seeds_in
from shared.messages import NodeId
from shared.process import ExitCode, end_with_parent, quieten_logging
from shared.simulation.scenario import Scenario, load_scenario
from shared.units import NS_PER_S

_log = structlog.stdlib.get_logger(__name__)


def rehearse(
    scenario: str,
    *,
    seeds: str = "1",
    output: Path,
    rssi: bool = True,
    with_parent: Annotated[bool, Parameter(show=False)] = False,
) -> int:
    """Let all DAPs of a scenario hear it offline, and write what they would have published.

    Leaves a wire log for each DAP, OUTPUT/SEED/DAP.wire. Example: dap-node rehearse four_daps
    --seeds 0-9 --output logs

    Parameters
    ----------
    scenario
        A packaged scenario's name, or a TOML file.
    seeds
        One seed, or the first and the last: 0-9.
    output
        Folder for the logs.
    rssi
        Publish every reading as well, for the record.
    with_parent
        End when standard input closes.

    """
    if with_parent:
        end_with_parent()
    try:
        loaded = load_scenario(scenario)
        jobs = [(seed, dap_id) for seed in seeds_in(seeds) for dap_id in loaded.daps]
    except ValueError as error:
        _log.error(str(error))
        return ExitCode.USAGE
    quieten_logging()
    console = Console(stderr=True)
    try:
        for seed, dap_id in track(
            jobs, "rehearsing", console=console, transient=True, disable=not console.is_terminal
        ):
            rehearse_dap(loaded, dap_id, seed, output / str(seed), sends_rssi=rssi)
    except OSError as error:
        _log.error(f"{error.filename}: cannot be written ({error.strerror}); give another --output")
        return ExitCode.USAGE
    return ExitCode.OK


def rehearse_dap(
    scenario: Scenario, dap_id: NodeId, seed: int, folder: Path, *, sends_rssi: bool = True
) -> None:
    """Write what ``dap_id`` would publish in the exercise of ``seed`` to ``folder``.

    ``sends_rssi``: every reading as well.
    """
    folder.mkdir(parents=True, exist_ok=True)
    clock = ManualClock()
    fault = scenario.fault_of(dap_id)
    with WireLogBus(folder / f"{dap_id}.wire", clock) as bus:
        node = DapNode(bus, REHEARSAL_INCIDENT, dap_id, sends_rssi=sends_rssi)
        for observation in SimulatedScanner(scenario, dap_id, seed).observations(
            REHEARSAL_START_NS
        ):
            clock.set_ns(observation.time_ns)
            told_s = (observation.time_ns - REHEARSAL_START_NS) / NS_PER_S
            ahead_ns = round(fault.clock_ahead_at_s(told_s) * NS_PER_S)
            node.take(observation._replace(time_ns=observation.time_ns + ahead_ns))
