"""``command-post click``, ``floor``, ``order`` and ``set-down``: tell running nodes something."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Annotated, Literal

import structlog
from cyclopts import Parameter, validators
from rich.console import Console

from command_post.commands.answers import POLL_S, answered
from shared.bus.interface import Bus
from shared.bus.zenoh_bus import open_zenoh
from shared.codec import Refusal, decode, parse_key
from shared.config import checked
from shared.exercise import ask_time_ns
from shared.gate import Gate
from shared.introductions import Introductions
from shared.messages import (
    DapInstallation,
    HeightFix,
    LocalPosition,
    Message,
    OrderAnswer,
    OrderKind,
    OrderRequest,
    PositionFix,
    SetDownHere,
)
from shared.node_options import Insecure, Keys, Metres
from shared.process import ExitCode
from shared.security.certificates import Identity
from shared.security.opening import local_endpoint, open_keys
from shared.sender import Sender, Unkept
from shared.topics import alive_key, check_id
from shared.units import NS_PER_MS

FIND_POST_S = 5.0
ANSWER_S = 5.0
ASK_PERIOD_S = 0.5

Deviation = Annotated[float, Parameter(validator=validators.Number(gt=0.0, lte=1e4))]


@Parameter(name="*")
@dataclass(frozen=True)
class Sayer:
    """The options of who says something: in which incident, to whom, and with what keys.

    Attributes
    ----------
    incident
        Name of the incident.
    connect
        The running post, or DAPs, to dial, one an option; by default port 7447 of this machine.
    keys
        Folder of the commander's keys, as of a post of that name ('command-post keys issue').
    insecure
        Do without keys, on one machine.
    commander_id
        Who says so; another name than the post's.

    """

    incident: str = "incident"
    connect: Annotated[tuple[str, ...], Parameter(consume_multiple=False)] = ()
    keys: Keys = None
    insecure: Insecure = False
    commander_id: Annotated[str, Parameter(name="--id")] = "commander"


_log = structlog.stdlib.get_logger(__name__)


def click(
    *,
    responder: str,
    north: Metres,
    east: Metres,
    down: Metres = 0.0,
    sd: Deviation = 2.0,
    sayer: Sayer = Sayer(),
) -> int:
    """Say where a responder is now, as by a click on the map: 'he is here'.

    Example: command-post click --keys keys/commander --responder r1 --north 12.5 --east=-3 --sd 1.5

    Parameters
    ----------
    responder
        Whom it is about.
    north
        Metres north of the incident's origin.
    east
        Metres east of it.
    down
        Metres below it; what floor they are on is better said by 'floor'.
    sd
        Give or take so many metres, in each direction (standard deviation).
    sayer
        Who says so.

    """

    def fix(time_ns: int, sequence: int) -> Message:
        """Say where they are."""
        place = LocalPosition(
            north_m=north, east_m=east, down_m=down, covariance_m2=(sd**2, 0.0, sd**2)
        )
        return PositionFix(
            event_time_ns=time_ns, sequence=sequence,
            responder_id=responder, source="commander", position=place,
        )  # fmt: skip

    return say(fix, sayer, "--responder", (responder,))


def floor(
    *,
    height: Metres,
    responder: str | None = None,
    dap: str | None = None,
    sd: Deviation = 0.5,
    sayer: Sayer = Sayer(),
) -> int:
    """Say on what floor a responder is now, or on what floor a DAP stands.

    Example: command-post floor --keys keys/commander --responder r1 --height 3.2

    Parameters
    ----------
    height
        Of the floor, in metres above the incident's origin.
    responder
        Whom it is about; or a DAP.
    dap
        Which DAP it is about; or a responder.
    sd
        Give or take so many metres (standard deviation).
    sayer
        Who says so.

    """
    node_id = responder or dap
    if node_id is None or (responder and dap):
        _log.error("floor: give either --responder or --dap")
        return ExitCode.USAGE

    def fix(time_ns: int, sequence: int) -> Message:
        """Say where they are."""
        return HeightFix(
            event_time_ns=time_ns, sequence=sequence,
            node="responder" if responder else "dap", node_id=node_id,
            down_m=-height, sd_m=sd,
        )  # fmt: skip

    option = "--responder" if responder else "--dap"
    return say(fix, sayer, option, (node_id,))


def order(
    kind: Literal["evacuate", "roll-call", "message", "withdraw"],
    *,
    to: Annotated[tuple[str, ...], Parameter(consume_multiple=False)] = (),
    everybody: Annotated[bool, Parameter(name="--all", negative="")] = False,
    text: str = "",
    sayer: Sayer = Sayer(),
) -> int:
    """Have the post order responders something, until each has acknowledged it.

    The post says it again and again to who has not, and shows who that is. Examples:
    command-post order evacuate --all --incident harbour --keys keys/commander;
    command-post order message --to r1 --to r2 --text 'to the north stair'

    Parameters
    ----------
    kind
        'withdraw' is to wait no longer for what was ordered: units that have it are not told.
    to
        A responder, one an option.
    everybody
        All responders; to evacuate, also those who are heard later.
    text
        What to tell them, up to 200 characters.
    sayer
        Who says so.

    """
    if bool(to) == everybody or (kind == "message" and not text):
        what = "a message needs --text" if bool(to) != everybody else "give either --to or --all"
        _log.error(f"order: {what}")
        return ExitCode.USAGE

    def request(time_ns: int, sequence: int) -> Message:
        which: OrderKind | Literal["withdraw"] = "roll_call" if kind == "roll-call" else kind
        return OrderRequest(event_time_ns=time_ns, sequence=sequence, kind=which, to=to, text=text)

    return say(request, sayer, "--to", to, await_outcome=_await_answer)


def set_down(
    *,
    dap: str,
    north: Metres,
    east: Metres,
    down: Metres = 0.0,
    sd: Deviation = 1.0,
    sayer: Sayer = Sayer(),
) -> int:
    """Tell a DAP that it stands at a place, as by a click on the map, and wait until it says so.

    Example: command-post set-down --keys keys/commander --dap dap1 --north 0 --east 1.5 --sd 0.3

    Parameters
    ----------
    dap
        Which DAP.
    north
        Metres north of the incident's origin.
    east
        Metres east of it.
    down
        Metres below it.
    sd
        Give or take so many metres, in each direction (standard deviation).
    sayer
        Who says so.

    """
    place = LocalPosition(
        north_m=north, east_m=east, down_m=down, covariance_m2=(sd**2, 0.0, sd**2)
    )

    def tell(time_ns: int, sequence: int) -> Message:
        return SetDownHere(event_time_ns=time_ns, sequence=sequence, dap_id=dap, position=place)

    return say(tell, sayer, "--dap", (dap,), await_outcome=_await_installation)


def _await_installation(bus: Bus, told: Message, sender: Sender, gate: Gate) -> int:
    """Tell a DAP where it stands until it says so: it may have to ask first who tells it."""
    if not isinstance(told, SetDownHere):
        raise TypeError(f"{type(told).__name__}: no DAP answers that")
    key = sender.key(DapInstallation, told.dap_id, "dap")
    give_up_s = time.monotonic() + ANSWER_S
    while time.monotonic() < give_up_s:
        sender.send(told)
        time.sleep(ASK_PERIOD_S)
        for received in bus.query(key, ASK_PERIOD_S):
            parsed = parse_key(received.key)
            if isinstance(parsed, Refusal) or gate.admit(*received) not in (None, "repeated"):
                continue
            said = decode(parsed, received.payload)
            if isinstance(said, DapInstallation) and said.position == told.position:
                return ExitCode.OK
    _log.error(f"{told.dap_id} does not say that it stands there; is it running, and in reach?")
    return ExitCode.FAILURE


def _await_answer(bus: Bus, request: Message, sender: Sender, gate: Gate) -> int:
    """Send a request, and say what the post answers."""
    answer = answered(
        bus, request, sender, gate, OrderAnswer, ANSWER_S,
        lambda _, answer: _answers(answer, sender.node_id, request),
    )  # fmt: skip
    if answer is not None:
        return _say_answer(answer)
    _log.error(
        "the post does not answer: it cannot be reached, or its disk does not keep the order; see"
        " its log, and whether the order is in its table"
    )
    return ExitCode.FAILURE


def _answers(answer: OrderAnswer, commander_id: str, request: Message) -> bool:
    return (answer.commander_id, answer.request_sequence) == (commander_id, request.sequence)


def _say_answer(answer: OrderAnswer) -> int:
    if answer.refusal is not None:
        _log.error(answer.refusal)
        return ExitCode.USAGE
    names = ", ".join(answer.waited_for) or "nobody so far"
    Console().print(names, highlight=False, markup=False)
    return ExitCode.OK


def say(
    message: Callable[[int, int], Message],
    sayer: Sayer,
    option: str,
    node_ids: Sequence[str],
    *,
    await_outcome: Callable[[Bus, Message, Sender, Gate], int] | None = None,
) -> int:
    """Publish ``message(time_ns, sequence)`` at the time of the post's clock, once one listens.

    ``await_outcome`` publishes it in place of this, and says what came of it.
    """
    incident, commander_id = sayer.incident, sayer.commander_id
    try:
        check_id(incident, "--incident")
        check_id(commander_id, "--id")
        for node_id in node_ids:
            check_id(node_id, option)
        checked(message(0, 0))
        bundle = open_keys(sayer.keys, Identity("post", commander_id), insecure=sayer.insecure)
        dialled = sayer.connect or (local_endpoint(bundle),)
        with (
            open_zenoh("client", connect=dialled, bundle=bundle) as bus,
            Introductions(bus, incident, bundle) as introductions,
        ):
            posts = _find_posts(bus, incident)
            if not posts:
                _log.error(f"no post of incident {incident!r} is heard; start it, or see --connect")
                return ExitCode.FAILURE
            if commander_id in posts:
                raise ValueError(f"--id {commander_id!r} is the post's own; give another")
            if not introductions.introduce():
                _log.error("the post does not show who it is; give keys of the same authority")
                return ExitCode.FAILURE
            gate = Gate(introductions.signers)
            now_ns = ask_time_ns(bus, incident, introductions.signers)
            outbox = Unkept(None if bundle is None else bundle.sign)
            sender = Sender(bus, incident, "post", commander_id, outbox)
            # Every order is a process of its own: counting by the clock, none repeats another.
            said = message(now_ns, now_ns // NS_PER_MS)
            if await_outcome is not None:
                return await_outcome(bus, said, sender, gate)
            sender.send(said)
            return ExitCode.OK
    except ValueError as error:
        _log.error(str(error))
        return ExitCode.USAGE


def _find_posts(bus: Bus, incident: str) -> set[str]:
    """Return the ids of the posts that are alive, as soon as one is heard."""
    posts: set[str] = set()

    def note(key: str, is_alive: bool) -> None:
        if is_alive:
            posts.add(key.split("/")[-2])

    bus.watch_alive(alive_key(incident, "post", "*"), note)
    give_up_s = time.monotonic() + FIND_POST_S
    while not posts and time.monotonic() < give_up_s:
        time.sleep(POLL_S)
    return set(posts)
