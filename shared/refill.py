"""How what was missed of a journal is asked for, and what of a reply is taken (pure)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, NamedTuple, TypeAlias

import msgspec
from msgspec import Meta

from shared.codec import MAX_PAYLOAD_BYTES, Refusal, parse_key
from shared.gate import JournalRun, Missing
from shared.kept import Row
from shared.messages import MessageNumber, RunId
from shared.received_numbers import Hole
from shared.seal import read_seal
from shared.topics import TOPICS

MOST_ROWS = 500
"""In one reply, whatever is asked for."""

MOST_REPLY_BYTES = 1 << 17

_LARGEST_REPLY_BYTES = MOST_REPLY_BYTES + 2 * MAX_PAYLOAD_BYTES

FetchRows: TypeAlias = Callable[[bytes, int, int, int, int], list[Row]]
"""Gives rows of a run: from number, to number, so many and so many bytes at most."""


class JournalRequest(msgspec.Struct, frozen=True, kw_only=True):
    """Please say again the messages ``first`` to ``last`` of a journal, as many as fit."""

    run: RunId
    first: MessageNumber
    last: MessageNumber
    most_rows: Annotated[int, Meta(ge=1, le=MOST_ROWS)] = MOST_ROWS


class _Reply(msgspec.Struct, frozen=True, array_like=True):
    """Messages as they were published: their keys, and their bytes."""

    rows: Annotated[list[tuple[str, bytes]], Meta(max_length=MOST_ROWS)]


class Refilled(NamedTuple):
    """What a reply brings: the messages asked for (key and bytes) by number, and how much else."""

    messages: dict[int, tuple[str, bytes]]
    unasked: int


_encoder = msgspec.msgpack.Encoder()
_requests = msgspec.msgpack.Decoder(JournalRequest)
_replies = msgspec.msgpack.Decoder(_Reply)


def request_of(missing: Missing, most_rows: int) -> bytes:
    """Return the request for the first ``most_rows`` of a hole."""
    first, last = missing.hole
    return _encoder.encode(
        JournalRequest(
            run=missing.journal.run.hex(),
            first=first,
            last=min(last, first + most_rows - 1),
            most_rows=most_rows,
        )
    )


def reply_to(request: bytes, fetch: FetchRows) -> bytes | None:
    """Return the reply to a request, of what ``fetch`` gives; ``None`` to what is none."""
    try:
        asked = _requests.decode(request)
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError, ValueError):
        return None
    run = bytes.fromhex(asked.run)
    rows = fetch(run, asked.first, asked.last, asked.most_rows, MOST_REPLY_BYTES)
    return _encoder.encode(_Reply([(row.key, row.payload) for row in rows]))


def refilled(reply: bytes, journal: JournalRun, incident: str, hole: Hole) -> Refilled:
    """Return what ``reply`` has of the numbers of ``hole``, each but once.

    Whether it is the node's own word is for the gate to say; nothing here raises.
    """
    if len(reply) > _LARGEST_REPLY_BYTES:
        return Refilled({}, 1)
    try:
        rows = _replies.decode(reply).rows
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError, ValueError):
        return Refilled({}, 1)
    found: dict[int, tuple[str, bytes]] = {}
    for key, payload in rows:
        number = _number(key, payload, journal, incident)
        if number is not None and hole.first <= number <= hole.last:
            found.setdefault(number, (key, payload))
    return Refilled(found, len(rows) - len(found))


def _number(key_text: str, payload: bytes, journal: JournalRun, incident: str) -> int | None:
    """Return the number of a message in ``journal``; ``None`` if it is of something else."""
    key = parse_key(key_text)
    if isinstance(key, Refusal) or not TOPICS[key.topic].journalled:
        return None
    if (key.incident, key.role, key.node_id) != (incident, journal.role, journal.node_id):
        return None
    seal = read_seal(payload) if len(payload) <= MAX_PAYLOAD_BYTES else None
    return seal.number if seal is not None and seal.run == journal.run else None
