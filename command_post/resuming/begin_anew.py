"""Beginning anew from what was told last, in place of all that was heard (pure)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from command_post.desks.announcer import Outgoing
from command_post.fusion.dap_map import InstalledDap
from command_post.fusion.interface import WayTold
from command_post.fusion.team.log import MEASURING_MOUNTS
from command_post.fusion.time_line import Event
from command_post.fusion.track import Estimate
from command_post.nodes.senders import Node
from command_post.nodes.told import is_taken_up
from command_post.resuming.last_told import LastTold
from shared.maths.angles import wrap_rad
from shared.messages import (
    DapInstallation,
    Message,
    OdometryIncrement,
    RssiPeak,
    TrackStart,
)


def ways_told(last: LastTold, heard: Sequence[Event]) -> dict[str, WayTold]:
    """Return where everybody was told to be, and how their units are turned.

    That is by how they headed at their last move by then, of what was ``heard``.
    """
    loose: dict[str, bool] = {}
    headed_rad: dict[str, float] = {}
    for event in heard:
        name = event.key.node_id
        match event.message:
            case TrackStart() as start:
                loose[name] = start.mount not in MEASURING_MOUNTS
                headed_rad.pop(name, None)
            case OdometryIncrement() as move:
                told = last.estimates.get(name)
                if told is not None and event.time_ns <= told.time_ns:
                    headed_rad[name] = move.heading_rad
    return {
        name: WayTold(*_turned(told, headed_rad.get(name)), is_loose=loose.get(name, False))
        for name, told in last.estimates.items()
    }


def _turned(told: Estimate, headed_rad: float | None) -> tuple[Estimate, float]:
    if headed_rad is None:
        # They have not moved since their unit began: it may be turned any way.
        return told._replace(heading_sd_rad=10.0), 0.0
    return told, wrap_rad(told.heading_rad - headed_rad)


def daps_told(last: LastTold, heard: Sequence[Event]) -> dict[str, InstalledDap]:
    """Return the DAPs that stand where they were told to, since when they were installed."""
    installed: dict[str, Event] = {
        event.key.node_id: event for event in heard if isinstance(event.message, DapInstallation)
    }
    found: dict[str, InstalledDap] = {}
    for dap_id, (_, _, place) in last.dap_places.items():
        event = installed.get(dap_id)
        if event is None:
            found[dap_id] = InstalledDap(place.position, place.event_time_ns, None)
        elif not _is_newer(event, place.event_time_ns):
            found[dap_id] = InstalledDap(place.position, event.time_ns, None)
    return found


def _is_newer(event: Event, placed_ns: int) -> bool:
    """Whether a DAP was taken up, or set down elsewhere, since it was told where it stands."""
    said = event.message
    is_gone = isinstance(said, DapInstallation) and is_taken_up(said)
    return is_gone or said.event_time_ns > placed_ns


def places_told(last: LastTold, daps: Mapping[str, InstalledDap]) -> dict[str, Outgoing]:
    """Return what was said last of where the ``daps`` stand."""
    return {
        dap_id: Outgoing(*said[:2]) for dap_id, said in last.dap_places.items() if dap_id in daps
    }


def begun_ns(last: LastTold) -> dict[Node, int]:
    """Return until when all that each responder tells is in what was told last of them."""
    return {("responder", name): told.time_ns for name, told in last.estimates.items()}


def still_to_fuse(
    heard: Sequence[Event], last: LastTold, daps: Mapping[str, InstalledDap]
) -> list[Event]:
    """Return of what was ``heard`` what is not in what was told last.

    That is what happened since; and of DAPs that stand where nobody has been told, that they do:
    where, those find who pass them.
    """
    events: list[Event] = []
    for event in heard:
        whose = _whose(event.key.node_id, event.message)
        told = last.estimates.get(whose)
        if isinstance(event.message, DapInstallation):
            if event.key.node_id not in daps:
                events.append(_found_by_passes(event, event.message, last))
        elif event.time_ns > (last.last_ns if told is None else told.time_ns):
            events.append(event)
    return events


def _whose(node_id: str, message: Message) -> str:
    return message.responder_id if isinstance(message, RssiPeak) else node_id


def _found_by_passes(event: Event, said: DapInstallation, last: LastTold) -> Event:
    told_ns = [told.time_ns for told in last.estimates.values()]
    if said.position is not None or said.installer_id is None or not told_ns:
        return event
    if event.time_ns >= min(told_ns):
        return event
    standing = DapInstallation(
        event_time_ns=said.event_time_ns, sequence=said.sequence, installer_id=None,
        position=None, at_rest=True,
    )  # fmt: skip
    return event._replace(message=standing)
