"""A DAP at work: what ``dap-node run`` opens, in which order, and what drives the node."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from pathlib import Path
from threading import Event

import structlog

from dap_node.box import SWITCHED_OFF, BoxDesk
from dap_node.kept_standing import KeptStanding
from dap_node.node import DapNode
from dap_node.scanners.live import live_observations
from dap_node.scanners.observation import Motion, Observation, SetDown
from dap_node.scanners.opening import Playable
from dap_node.self_installation import SelfInstallation
from dap_node.settings import DapSettings
from dap_node.work import Work
from shared.bus.interface import Bus
from shared.bus.refused_links import counted_at_links
from shared.clock import Clock
from shared.exercise import await_exercise
from shared.files import FileHeldError
from shared.gate import Gate
from shared.kept_stations import KeptStations
from shared.messages import NodeId, StationTable
from shared.node import Node, linked
from shared.process import (
    ExitCode,
    set_by_button,
    stop_on_signals,
    stop_with_parent,
    wait_until,
)
from shared.radios.live import LiveSource
from shared.radios.readings import RadioScan
from shared.security.bundle import Bundle
from shared.strangers import AtLinks
from shared.topics import Key, Role, alive_key

POLL_S = 0.1

_log = structlog.stdlib.get_logger(__name__)


def work(told: Work) -> int:
    """Be the DAP that is ``told``, until SIGINT or SIGTERM or its exercise is over.

    Return the process's exit code.
    """
    try:
        bundle, settings, stations = told.open_keys(), told.settings(), told.station_table()
        opened = told.opened()
        with (
            stop_on_signals() as stop,
            set_by_button() as button,
            counted_at_links(bundle) as at_links,
            linked(
                told.identity, told.incident, bundle, told.journal_file, stop,
                connect=told.dialled(bundle), listen=told.endpoints(bundle),
            ) as node,
        ):  # fmt: skip
            if told.with_parent:
                stop_with_parent(stop)
            with node.beating(told.journal_file):
                new_dap = partial(
                    _dap, node, told.journal_file, settings, stations, at_links, roles_of(bundle)
                )
                if isinstance(opened, Playable):
                    dap = new_dap(watch=None)
                    _play(node, dap, opened, None if told.await_start else told.speed)
                else:
                    dap = new_dap(watch=SelfInstallation(notices=told.by_itself))
                    observations = live_observations(opened, node.clock, stop, button)
                    follow_live(node, dap, observations, partial(gone, opened))
                node.bus.ask_no_more()
    except (ValueError, OSError, FileHeldError) as error:
        _log.error(str(error))
        return ExitCode.FAILURE if isinstance(error, OSError) else ExitCode.USAGE
    return ExitCode.OK


def _dap(
    node: Node, journal: Path, settings: DapSettings, stations: StationTable | None,
    at_links: AtLinks, role_of: Callable[[str], Role], *, watch: SelfInstallation | None,
) -> DapNode:  # fmt: skip
    """Return the DAP, standing where it did before it was broken off.

    A real one, which a ``watch`` helps to find out where it stands, keeps that beside its
    ``journal``; one of an exercise has said it.
    """
    known, place = KeptStations(journal), KeptStanding(journal, node.incident, node.node_id)
    dap = DapNode(
        node.bus, node.incident, node.node_id, settings, outbox=node.outbox,
        gate=Gate(node.verifier), stations=stations or known.load(), keep_stations=known.keep,
        keep_place=(lambda _: None) if watch is None else place.keep,
        watch=watch, at_links=at_links, role_of=role_of,
    )  # fmt: skip
    said = _said_before(node) if watch is None else place.load()
    if said is not None:
        dap.go_on(said)
    return dap


def gone(sources: Sequence[LiveSource[RadioScan | Motion]]) -> list[str]:
    """Return the names of the ``sources`` that are gone, and looked for."""
    return [source.name for source in sources if source.is_away]


def follow_live(
    node: Node,
    dap: DapNode,
    observations: Iterable[Observation],
    are_gone: Callable[[], Sequence[str]] = tuple,
) -> None:
    """Hand each observation to the DAP; say what its box is like, and why it goes off at last."""
    box = BoxDesk(node.sender(), gone=are_gone)
    why = SWITCHED_OFF
    try:
        for observation in observations:
            dap.take(observation)
            box.pass_time(observation.time_ns)
    except Exception as error:
        why = f"failed: {error}"
        raise
    finally:
        box.go_off(node.clock.now_ns(), why)


def roles_of(bundle: Bundle | None) -> Callable[[str], Role]:
    """Return who tells a named node's role; of whom nobody has heard it is a responder's."""
    roles: dict[str, Role] = {}
    if bundle is not None:
        roles = {each.id: each.role for each in bundle.nodes.nodes}
    return lambda node_id: roles.get(node_id, "responder")


def _said_before(node: Node) -> bytes | None:
    """Return what a DAP of an exercise said of its place before it was broken off."""
    said = node.outbox.newest(str(Key(node.incident, "dap", node.node_id, "installation")))
    return said if node.outbox.broken_off else None


def _play(node: Node, dap: DapNode, scanner: Playable, speed: float | None) -> None:
    """Follow the scanner from now on at ``speed``; without, from the exercise's start at its own.

    Then stay for those who may need a relay. Who comes to an exercise late follows it from then on.
    """
    company = Company(node.bus, node.incident)
    start_ns = node.clock.now_ns()
    if speed is None:
        exercise = await_exercise(node.bus, node.incident, Gate(node.verifier), node.stop)
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
