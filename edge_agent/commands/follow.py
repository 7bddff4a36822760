"""``edge-agent run``: follow a responder, live."""

from __future__ import annotations

import socket
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, nullcontext
from pathlib import Path
from threading import Event
from typing import Annotated

import structlog
from cyclopts import Parameter, validators

from edge_agent.agent import Agent
from edge_agent.commands.prepare import prepared_mount
from edge_agent.commands.unit_options import Beginning, Devices, UnitItself, Worn
from edge_agent.drop_desk import DropDesk, tell_wearer_to_set_down
from edge_agent.following import play, take_part, tell_losses
from edge_agent.mayday import MaydayCall
from edge_agent.mayday_controls import Control, InputButton, UnitSocket, socket_path
from edge_agent.mayday_desk import MaydayDesk
from edge_agent.mounts.interface import Mount
from edge_agent.order_desk import OrderDesk, tell_wearer
from edge_agent.orders import OrderBook
from edge_agent.radio_desk import RadioDesk
from edge_agent.site_desk import SiteDesk
from edge_agent.sources.opening import check_source, open_source
from edge_agent.sources.recording import SourceError
from edge_agent.supply_gauge import SupplyGauge
from shared.codec import Refusal, decode, parse_key
from shared.config import ConfigError
from shared.files import FileHeldError
from shared.gate import Gate
from shared.kept_stations import KeptStations
from shared.messages import LocalPosition, Mayday, TrackStart
from shared.node import Node, linked
from shared.node_options import Seed
from shared.process import (
    ExitCode,
    ended_by_signals,
    set_by_button,
    stop_on_signals,
    stop_with_parent,
)
from shared.radios.opening import open_radios
from shared.sender import Sender
from shared.topics import alive_key

_log = structlog.stdlib.get_logger(__name__)


def run(
    *,
    itself: UnitItself,
    source: str,
    worn: Worn = Worn(),  # noqa: B008 - it is frozen
    beginning: Beginning = Beginning(),  # noqa: B008 - it is frozen
    speed: Annotated[float, Parameter(validator=validators.Number(gt=0.0, lte=1e4))] = 1.0,
    seed: Seed = 1,
    imu: bool = True,
    has: Devices = Devices(),  # noqa: B008 - it is frozen
    await_start: bool = False,
    with_parent: Annotated[bool, Parameter(show=False)] = False,
) -> int:
    """Follow one responder and publish their movement, until the source ends or SIGINT, SIGTERM.

    Examples: edge-agent run --id r1 --source csv:walk.csv --keys keys/r1
    --connect tls/192.168.7.11:7447;
    edge-agent run --id r1 --source simulated:four_daps --insecure --stands-at=-1.5,0.4

    Parameters
    ----------
    itself
        Whose unit it is.
    source
        csv:FILE (a vendor's export), npz:FILE, phone:EXPORT (a folder or .zip of the phone app
        'Sensor Logger'), phone-live:HOST:PORT (a phone that sends what it reads, by a page or that
        app), mcap:FILE[#responder] or simulated:SCENARIO.
    worn
        How the sensor is worn.
    beginning
        Where the wearer stands at first.
    speed
        How many times as fast as it was recorded.
    seed
        Of a simulated source.
    imu
        Publish the raw samples as well, for the record.
    has
        What else the wearer has.
    await_start
        Begin with the exercise, at its speed, and stay until stopped.
    with_parent
        Stop when standard input closes.

    """
    try:
        bundle = itself.open_keys()
        dialled = itself.dialled(bundle)
        known_point, place = beginning.known_point, beginning.place
        check_source(source)
        # A sensor that is read already would wait, or lose, what comes while code is built.
        with ended_by_signals():
            follower = prepared_mount(
                worn.mount, worn.method, told=worn.told, driven_speed_m_s=worn.driven_speed
            )
        opened = open_source(
            source, itself.responder_id, seed, worn.mount, bundle, hears_daps=has.daps > 0
        )
        radios = open_radios(has.radio, "--radio")
        with (
            stop_on_signals() as stop,
            set_by_button() as acknowledged,
            linked(
                itself.identity, itself.incident, bundle, itself.journal_file, stop,
                connect=dialled,
            ) as node,
        ):  # fmt: skip
            if with_parent:
                stop_with_parent(stop)
            drop_desk = _drop_desk(node.sender(), has.daps)
            agent = _agent(
                node, follower, worn, place or opened.start, known_point,
                imu=imu, drop_desk=drop_desk,
            )  # fmt: skip
            node.bus.answer(node.sender().key(TrackStart), lambda _: agent.start_payload)
            with (
                _orders_heeded(node, itself, acknowledged, agent, drop_desk, has.supplies),
                _mayday_desk(node, itself, has.button, opened.controls),
                RadioDesk(
                    node, radios, KeptStations(itself.journal_file), has.radio_offset, drop_desk
                ),
            ):
                node.bus.declare_alive(alive_key(node.incident, node.role, node.node_id))
                if await_start:
                    take_part(node, agent, opened)
                else:
                    play(node, agent, opened, speed)
                node.bus.ask_no_more()
            tell_losses(agent, follower.faults, node.bus.unsent)
    except (SourceError, ConfigError, ValueError, FileHeldError) as error:
        _log.error(str(error))
        return ExitCode.USAGE
    return ExitCode.OK


def _agent(
    node: Node, follower: Mount, worn: Worn, place: LocalPosition | None,
    known_point: LocalPosition | None, *, imu: bool, drop_desk: DropDesk | None,
) -> Agent:  # fmt: skip
    """Return who follows the wearer; after a kill the post knows better where they stand."""
    sender, outbox = node.sender(), node.outbox
    agent = Agent(
        sender, follower, worn.chosen_method, place, worn=worn.mount,
        sends_imu=imu, stands_at=known_point, keeps=lambda: outbox.fault is None,
        drop_desk=drop_desk,
    )  # fmt: skip
    if outbox.broken_off and outbox.newest(sender.key(TrackStart)) is not None:
        _log.warning("goes on where it was broken off: the post knows where they stand")
        agent.forget_place()
    return agent


def _drop_desk(sender: Sender, daps: int) -> DropDesk | None:
    """Return where a wearer with ``daps`` is told to set one down; ``None`` for one without."""
    return DropDesk(sender, daps, tell_wearer_to_set_down) if daps else None


@contextmanager
def _orders_heeded(
    node: Node, itself: UnitItself, acknowledged: Event, agent: Agent,
    drop_desk: DropDesk | None, supplies: Path | None,
) -> Iterator[None]:  # fmt: skip
    """Have the unit's heart beat, and heed what its post orders, by the time that it is there."""
    with (
        node.beating(
            itself.journal_file, SupplyGauge(supplies), lambda: agent.followed_until_ns
        ) as node_time,
        OrderDesk(
            node.bus, node.incident, OrderBook(node.node_id, itself.post_id), node.sender(),
            Gate(node.verifier), node.clock, acknowledged, tell_wearer, node_time.post_time_ns,
        ),
        nullcontext()
        if drop_desk is None
        else SiteDesk(node, itself.post_id, drop_desk, node_time.post_time_ns),
    ):  # fmt: skip
        yield


def _mayday_desk(
    node: Node, itself: UnitItself, button: Path | None, others: Sequence[Control]
) -> MaydayDesk:
    """Return where the wearer calls for help; a call that a kill broke off goes on."""
    call, sender = MaydayCall(node.node_id, itself.post_id), node.sender()
    said = node.outbox.newest(sender.key(Mayday)) if node.outbox.broken_off else None
    key = parse_key(sender.key(Mayday))
    if said is not None and not isinstance(key, Refusal):
        before = decode(key, said)
        if isinstance(before, Mayday):
            call.go_on(before)
    controls = [*others, *([] if button is None else [InputButton(button)])]
    # Where there is no such socket (Windows) there is the button alone.
    if hasattr(socket, "AF_UNIX"):
        controls.append(UnitSocket(socket_path(itself.journal_file)))
    return MaydayDesk(
        node.bus, node.incident, call, sender, Gate(node.verifier), node.clock, controls,
        node.bus.connected,
    )  # fmt: skip
