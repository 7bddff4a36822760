"""How the nodes of a simulated exercise begin together, and what time it is in one."""

from __future__ import annotations

from collections.abc import Iterable
from threading import Event

from shared.bus.inbox import Inbox
from shared.bus.interface import Bus, Received
from shared.clock import PacedClock, SystemClock
from shared.codec import Refusal, decode, parse_key
from shared.gate import Gate, Verifier
from shared.messages import ExerciseStart, NodeId
from shared.time_service import TimeAsker
from shared.topics import Key
from shared.units import NS_PER_S

REHEARSAL_START_NS = 1_767_225_600 * NS_PER_S
"""When every rehearsal begins, so that it comes out the same each time: 2026-01-01 00:00 UTC."""

REHEARSAL_INCIDENT = "rehearsal"

HEAR_S = 0.2
ASK_TIMEOUT_S = 0.5
MOST_SEEDS = 1_000_000


def await_exercise(bus: Bus, incident: NodeId, gate: Gate, stop: Event) -> ExerciseStart | None:
    """Wait until the start of the exercise is given; ``None`` if ``stop`` is set before.

    ``gate`` lets in who may give it. Who joins late is told as well: as long as nothing is heard,
    the posts are asked.
    """
    key = str(Key(incident, "post", "*", "exercise"))
    inbox: Inbox[Received] = Inbox(16)
    bus.subscribe(key, inbox.put)
    while not stop.is_set():
        start = _first_start(inbox.get_all(HEAR_S), gate)
        start = start or _first_start(bus.query(key, ASK_TIMEOUT_S), gate)
        if start is not None:
            return start
    return None


def ask_time_ns(bus: Bus, incident: NodeId, verifier: Verifier | None) -> int:
    """Return what time it is at the post, or here if no post tells.

    ``verifier`` knows who may tell it, or give an exercise, whose time then counts.
    """
    clock = PacedClock(SystemClock())
    key = str(Key(incident, "post", "*", "exercise"))
    start = _first_start(bus.query(key, ASK_TIMEOUT_S), Gate(verifier))
    if start is not None:
        clock.run_from(start.event_time_ns, start.speed)
    asker = TimeAsker(bus, incident, clock, verifier)
    asker.ask()
    stated = asker.stated()
    return clock.now_ns() + (0 if stated is None else stated.offset.offset_ns)


def _first_start(heard: Iterable[Received], gate: Gate) -> ExerciseStart | None:
    for received in heard:
        key = parse_key(received.key)
        if not isinstance(key, Refusal) and gate.admit(*received) is None:
            message = decode(key, received.payload)
            if isinstance(message, ExerciseStart):
                return message
    return None


def seeds_in(text: str) -> range:
    """Return the seeds that ``text`` names, as in ``7`` or ``0-9``; ``ValueError`` if none."""
    first, dash, last = text.partition("-")
    if first.isdecimal() and (last.isdecimal() if dash else not last):
        seeds = range(int(first), int(last if dash else first) + 1)
        if 0 < seeds.stop - seeds.start <= MOST_SEEDS and seeds.stop <= 2**63:
            return seeds
    raise ValueError(
        f"--seeds {text!r}: write one, as in 7, or the first and the last, as in 0-9, "
        f"{MOST_SEEDS} at most"
    )
