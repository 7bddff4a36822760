"""Seals: what tells of a message's bytes in which run they were numbered, and who says them (pure).

A seal is the tail of the message's own MessagePack map: the entries ``_run`` (8 bytes),
``_number`` and, where keys have been issued, ``_signature`` (64 bytes, over the key and all that
stands before it). So sealed bytes are still the message: who knows nothing of seals passes over
the entries. No field of a message begins with an underscore.

A *run* is one count of messages from 1 on: a journal's, or, of what is in no journal, a process's.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from typing import NamedTuple

RUN_BYTES = 8
SIGNATURE_BYTES = 64

_RUN = b"\xa4_run\xc4\x08"
_NUMBER = b"\xa7_number\xcf"
_SIGNATURE = b"\xaa_signature\xc4\x40"
_NUMBERING_BYTES = len(_RUN) + RUN_BYTES + len(_NUMBER) + 8
_SIGNATURE_TAIL_BYTES = len(_SIGNATURE) + SIGNATURE_BYTES

_LONGEST_FIXMAP = 15
_FIXMAP, _MAP16 = 0x80, 0xDE


class Seal(NamedTuple):
    """What a seal says. ``signed`` is what ``signature`` is over, the key apart."""

    run: bytes
    number: int
    signature: bytes | None
    signed: bytes


def sealed(payload: bytes, run: bytes, number: int) -> bytes:
    """Return the map ``payload`` with its ``run`` and ``number`` behind it.

    Raises ``ValueError`` for what is no map of fewer than 65,000 entries, as every message is one.
    """
    if len(run) != RUN_BYTES:
        raise ValueError(f"run of {len(run)} bytes: must be {RUN_BYTES}")
    return b"".join((_grown(payload, 2), _RUN, run, _NUMBER, struct.pack(">Q", number)))


def signed(sealed_payload: bytes, key: str, sign: Callable[[bytes], bytes]) -> bytes:
    """Return ``sealed_payload`` with the signature that ``sign`` makes for it under ``key``."""
    grown = _grown(sealed_payload, 1)
    return b"".join((grown, _SIGNATURE, sign(to_be_signed(key, grown))))


def to_be_signed(key: str, signed_part: bytes) -> bytes:
    """Return what a signature is over: nobody can pass it off under another key."""
    return key.encode() + b"\0" + signed_part


def read_seal(payload: bytes) -> Seal | None:
    """Return the seal at the end of ``payload``; ``None`` if there is none."""
    signature, body = None, payload
    at = len(payload) - _SIGNATURE_TAIL_BYTES
    if at > 0 and payload.startswith(_SIGNATURE, at):
        body, signature = payload[:at], payload[at + len(_SIGNATURE) :]
    at = len(body) - _NUMBERING_BYTES
    number_at = at + len(_RUN) + RUN_BYTES
    if at <= 0 or not body.startswith(_RUN, at) or not body.startswith(_NUMBER, number_at):
        return None
    (number,) = struct.unpack(">Q", body[-8:])
    return Seal(body[at + len(_RUN) : number_at], number, signature, body)


def _grown(payload: bytes, entries: int) -> bytes:
    """Return the MessagePack map ``payload``, its header saying so many ``entries`` more."""
    first = payload[0] if payload else 0
    if first & 0xF0 == _FIXMAP:
        count, body = first & 0x0F, payload[1:]
    elif first == _MAP16 and len(payload) >= 3:
        count, body = int.from_bytes(payload[1:3], "big"), payload[3:]
    else:
        raise ValueError("only a MessagePack map can be sealed")
    count += entries
    if count <= _LONGEST_FIXMAP:
        return bytes([_FIXMAP | count]) + body
    return bytes([_MAP16]) + count.to_bytes(2, "big") + body
