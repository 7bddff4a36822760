"""``dap-node run`` and ``dap-node rehearse``: a DAP at work, live or offline."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import nullcontext
from pathlib import Path
from threading import Event
from typing import Annotated

import structlog
from cyclopts import Parameter, validators
from rich.console import Console
from rich.progress import track

from dap_node.node import DapNode
from dap_node.scanners.observation import Observation, SetDown
from dap_node.scanners.simulated import SimulatedScanner
from dap_node.settings import DapSettings
from shared.bus.interface import Bus
from shared.bus.refused_links import RefusedLinks
from shared.bus.wire_log import WireLogBus
from shared.bus.zenoh_bus import open_zenoh
from shared.clock import Clock, ManualClock, PacedClock, SystemClock
from shared.config import load_toml
from shared.exercise import REHEARSAL_INCIDENT, REHEARSAL_START_NS, await_exercise, seeds_in
from shared.files import FileHeldError
from shared.gate import Gate
from shared.introductions import Introductions
from shared.journal_place import JournalFile, journal_path
from shared.messages import NodeId
from shared.node import Node
from shared.node_time import NodeTime
from shared.outbox import JournalledOutbox
from shared.process import (
    ExitCode,
    end_with_parent,
    quieten_logging,
    stop_on_signals,
    stop_with_parent,
    wait_until,
)
from shared.security.certificates import Identity
from shared.security.opening import Insecure, Keys, local_endpoint, open_keys
from shared.simulation.scenario import Scenario, load_scenario
from shared.topics import Key, alive_key, check_id

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
    journal: JournalFile = None,
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
    journal
        File that keeps what is said until the post has it; by default one of this DAP's in the
        incident, among what programs keep for the user.
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
        listened = [listen or local_endpoint(bundle, port=0)]
        kept = journal_path(journal, incident, "dap", dap_id)
        with (
            stop_on_signals() as stop,
            JournalledOutbox(kept, None if bundle is None else bundle.sign) as outbox,
            nullcontext() if bundle is None else RefusedLinks(),
            open_zenoh("router", dialled, listened, bundle) as bus,
            Introductions(bus, incident, bundle) as introductions,
        ):
            if with_parent:
                stop_with_parent(stop)
            node = Node(
                bus, incident, "dap", dap_id, outbox, introductions.signers,
                PacedClock(SystemClock()), SystemClock().now_ns(), stop,
            )  # fmt: skip
            with (
                NodeTime(bus, incident, node.clock, outbox, kept, node.verifier) as node_time,
                node.heartbeat(node_time.statement),
            ):
                _serve(node, settings, scanner, None if await_start else speed)
                bus.ask_no_more()
    except (ValueError, OSError, FileHeldError) as error:
        _log.error(str(error))
        return ExitCode.FAILURE if isinstance(error, OSError) else ExitCode.USAGE
    return ExitCode.OK


def _serve(
    node: Node, settings: DapSettings, scanner: SimulatedScanner, speed: float | None
) -> None:
    """Follow the scanner from now on at ``speed``; without, from the exercise's start at its own.

    Then stay for those who may need a relay. Who comes to an exercise late follows it from then on.
    """
    bus, incident, outbox = node.bus, node.incident, node.outbox
    gate = Gate(node.verifier)
    dap = DapNode(bus, incident, node.node_id, settings, outbox=outbox, gate=gate)
    said = outbox.newest(str(Key(incident, "dap", node.node_id, "installation")))
    if outbox.broken_off and said is not None:
        dap.go_on(said)
    company = Company(bus, incident)
    start_ns = node.clock.now_ns()
    if speed is None:
        exercise = await_exercise(bus, incident, gate, node.stop)
        if exercise is None:
            return
        start_ns, speed = exercise.event_time_ns, exercise.speed
    node.clock.run_from(start_ns, speed)
    observations = scanner.observations(start_ns)
    if start_ns < node.came_ns:
        knows_place = dap.stage != "carried"
        observations = from_then_on(observations, node.clock.now_ns(), is_set_down=knows_place)
    follow(dap, observations, node.clock, node.stop)
    company.wait_until_gone(node.stop)


def from_then_on(
    observations: Iterable[Observation], now_ns: int, *, is_set_down: bool
) -> Iterator[Observation]:
    """Leave out what was before ``now_ns``, save that the DAP was set down if it does not know."""
    for observation in observations:
        known = is_set_down or not isinstance(observation, SetDown)
        if observation.time_ns >= now_ns or not known:
            yield observation


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
