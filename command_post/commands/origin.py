"""``command-post origin set``: tell a running post where on the Earth the incident is."""

from __future__ import annotations

from typing import Literal

import structlog

from command_post.commands import orders
from command_post.commands.answers import answered
from command_post.commands.orders import Sayer, say
from shared.bus.interface import Bus
from shared.gate import Gate
from shared.geodesy import parse_origin
from shared.messages import Message, OriginSet
from shared.process import ExitCode
from shared.sender import Sender

_log = structlog.stdlib.get_logger(__name__)


def origin(
    action: Literal["set"],  # noqa: ARG001
    place: str,
    *,
    sayer: Sayer = Sayer(),  # noqa: B008 - it is frozen
) -> int:
    """Say where on the Earth the incident's origin is, or correct it, and wait until it is so.

    The map for others and TAK follow at once; it stands in the recording. Example:
    command-post origin set 37.5665,126.978,38,12.5 --incident harbour --keys keys/commander

    Parameters
    ----------
    action
        What to do.
    place
        LATITUDE,LONGITUDE[,HEIGHT[,BEARING]], degrees and metres above the ellipsoid; BEARING is
        how far the incident's north is clockwise of true north. Write '-- -33.8,151.2' in the
        south.
    sayer
        Who says so.

    """
    try:
        where = parse_origin(place)
    except ValueError as error:
        _log.error(str(error).replace("--origin", "origin set", 1))
        return ExitCode.USAGE

    def request(time_ns: int, sequence: int) -> Message:
        return where.as_message(time_ns, sequence)

    return say(request, sayer, "--id", (sayer.commander_id,), await_outcome=_await_statement)


def _await_statement(bus: Bus, asked: Message, sender: Sender, gate: Gate) -> int:
    """Send it, and wait until the post says that this is where the incident is."""
    said = answered(
        bus, asked, sender, gate, OriginSet, orders.ANSWER_S,
        lambda key, said: key.node_id != sender.node_id and _says_so(said, asked),
    )  # fmt: skip
    if said is not None:
        return ExitCode.OK
    _log.error("the post does not answer; see its log")
    return ExitCode.FAILURE


def _says_so(said: OriginSet, asked: Message) -> bool:
    return isinstance(asked, OriginSet) and said.where == asked.where
