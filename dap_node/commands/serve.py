"""``dap-node run`` and ``dap-node rehearse``: a DAP at work, live or offline."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from threading import Event
from typing import Annotated

import structlog
from cyclopts import Parameter, validators
from rich.console import Console
from rich.progress import track

from dap_node.node import DapNode
from dap_node.scanners.observation import Observation
from dap_node.scanners.simulated import SimulatedScanner
from dap_node.settings import DapSettings
from shared.bus.interface import Bus
from shared.bus.wire_log import WireLogBus
from shared.bus.zenoh_bus import open_zenoh
from shared.clock import Clock, ManualClock, ScaledClock, SystemClock
from shared.config import load_toml
from shared.exercise import REHEARSAL_INCIDENT, REHEARSAL_START_NS, await_exercise, seeds_in
from shared.gate import Gate
from shared.introductions import Introductions
from shared.messages import NodeId
from shared.process import (
    ExitCode,
    configure_logging,
    end_with_parent,
    stop_on_signals,
    stop_with_parent,
    wait_until,
)
from shared.security.certificates import Identity
from shared.security.opening import Insecure, Keys, local_endpoint, open_keys
from shared.sender import Unkept
from shared.simulation.scenario import Scenario, load_scenario
from shared.topics import alive_key, check_id

SIMULATED = "simulated:"
POLL_S = 0.1

_log = structlog.stdlib.get_logger(__name__)


def run(
    *,
    dap_id: Annotated[str, Parameter(name="--id")],
    scan: str,
    incident: str = "incident",
    connect: Annotated[tuple[str, ...], Parameter(consume_multiple=False)] = (),
    listen: str | None = None,
    keys: Keys = None,
    insecure: Insecure = False,
    config: Path | None = None,
    seed: Annotated[int, Parameter(validator=validators.Number(gte=0))] = 1,
    speed: Annotated[float, Parameter(validator=validators.Number(gt=0.0, lte=1e4))] = 1.0,
    await_start: bool = False,
    with_parent: Annotated[bool, Parameter(show=False)] = False,
) -> int:
    """Say who is near this DAP and where it stands, and relay for others.

    Runs until SIGINT or SIGTERM, or until a simulated exercise is over and no responder is alive
    that it might relay for. Example: dap-node run --id dap2 --scan simulated:four_daps
    --keys keys/dap2 --listen tls/0.0.0.0:7447 --connect tls/192.168.7.10:7447

    Parameters
    ----------
    dap_id
        Name of the DAP.
    scan
        Where signal strengths come from: simulated:SCENARIO.
    incident
        Name of the incident.
    connect
        Posts and DAPs to dial, one an option; the links to all are kept up. By default port 7447
        of this machine.
    listen
        Where agents and other DAPs find this one; by default a free port of this machine.
    keys
        Folder of this DAP's keys: 'command-post keys issue' makes it.
    insecure
        Do without keys, on one machine: nothing is encrypted or authenticated.
    config
        TOML file with offset_db, [proximity] and [peaks] for another radio than the usual.
    seed
        Of a simulated scan.
    speed
        How many times as fast as real, of a simulated scan.
    await_start
        Begin with the exercise, at its speed.
    with_parent
        Stop when standard input closes.

    """
    try:
        check_id(incident, "--incident")
        check_id(dap_id, "--id")
        bundle = open_keys(keys, Identity("dap", dap_id), insecure=insecure)
        settings = load_toml(config, DapSettings) if config else DapSettings()
        scanner = open_scanner(scan, dap_id, seed)
        dialled = connect or (local_endpoint(bundle),)
        bus = open_zenoh("router", dialled, [listen or local_endpoint(bundle, port=0)], bundle)
    except (ValueError, OSError) as error:
        _log.error(str(error))
        return ExitCode.FAILURE if isinstance(error, OSError) else ExitCode.USAGE
    with (
        bus,
        Introductions(bus, incident, bundle) as introductions,
        stop_on_signals() as stop,
    ):
        if with_parent:
            stop_with_parent(stop)
        gate = Gate(introductions.signers)
        outbox = Unkept(None if bundle is None else bundle.sign)
        node = DapNode(bus, incident, dap_id, settings, outbox=outbox, gate=gate)
        _serve(bus, incident, node, scanner, gate, stop, None if await_start else speed)
    return ExitCode.OK


def _serve(
    bus: Bus,
    incident: NodeId,
    node: DapNode,
    scanner: SimulatedScanner,
    gate: Gate,
    stop: Event,
    speed: float | None,
) -> None:
    """Follow the scanner from now on at ``speed``; without, from the exercise's start at its own.

    Then stay for those who may need a relay.
    """
    company = Company(bus, incident)
    start_ns = SystemClock().now_ns()
    if speed is None:
        exercise = await_exercise(bus, incident, gate, stop)
        if exercise is None:
            return
        start_ns, speed = exercise.event_time_ns, exercise.speed
    follow(node, scanner.observations(start_ns), ScaledClock(start_ns, speed), stop)
    company.wait_until_gone(stop)


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
    configure_logging("warning")
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


def open_scanner(scan: str, dap_id: NodeId, seed: int) -> SimulatedScanner:
    """Return the scanner that ``--scan`` names; ``ValueError`` if it cannot be used."""
    if not scan.startswith(SIMULATED):
        raise ValueError(f"--scan {scan!r}: write {SIMULATED}SCENARIO, as in simulated:four_daps")
    return SimulatedScanner(load_scenario(scan.removeprefix(SIMULATED)), dap_id, seed)


def follow(node: DapNode, observations: Iterable[Observation], clock: Clock, stop: Event) -> None:
    """Hand each observation to the node as the clock comes to its time, until ``stop`` is set."""
    for observation in observations:
        if not wait_until(clock, observation.time_ns, stop):
            return
        node.take(observation)


class Company:
    """The responders of an incident that are alive: their messages may come this way."""

    def __init__(self, bus: Bus, incident: NodeId) -> None:
        self._alive: set[str] = set()
        bus.watch_alive(alive_key(incident, "responder", "*"), self._note)

    def wait_until_gone(self, stop: Event) -> None:
        """Wait until there are none, or until ``stop`` is set."""
        while self._alive and not stop.wait(POLL_S):
            pass

    def _note(self, key: str, is_alive: bool) -> None:
        if is_alive:
            self._alive.add(key)
        else:
            self._alive.discard(key)


def rehearse_dap(
    scenario: Scenario, dap_id: NodeId, seed: int, folder: Path, *, sends_rssi: bool = True
) -> None:
    """Write what ``dap_id`` would publish in the exercise of ``seed`` to ``folder``.

    ``sends_rssi``: every reading as well.
    """
    folder.mkdir(parents=True, exist_ok=True)
    clock = ManualClock()
    with WireLogBus(folder / f"{dap_id}.wire", clock) as bus:
        node = DapNode(bus, REHEARSAL_INCIDENT, dap_id, sends_rssi=sends_rssi)
        for observation in SimulatedScanner(scenario, dap_id, seed).observations(
            REHEARSAL_START_NS
        ):
            clock.set_ns(observation.time_ns)
            node.take(observation)
