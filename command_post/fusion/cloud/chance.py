"""Keys of the random numbers: whose they are, at which step, and for what.

A number depends on its key and place alone, never on how many were drawn before it. So a step that
is made again after late data, or by another process, is made the same.
"""

from __future__ import annotations

from hashlib import blake2b
from typing import NamedTuple

_MASK = 2**64 - 1


class Key(NamedTuple):
    """Two words of 32 bits."""

    low: int
    high: int


def responder_stream(seed: int, responder_id: str) -> int:
    """Return the number that all keys of a responder come from."""
    told = seed.to_bytes(8, "little") + responder_id.encode()
    return int.from_bytes(blake2b(told, digest_size=8).digest(), "little")


def step_key(stream: int, step: int, use: int = 0) -> Key:
    """Return the key of step number ``step`` of a stream; ``use`` tells apart what shares a step.

    Both are whole numbers from 0 below 2⁶⁴. Mixed twice by splitmix64's finaliser (Steele, Lea and
    Flood 2014).
    """
    mixed = _mix(_mix((stream + 0x9E3779B97F4A7C15 * (step + 1)) & _MASK) ^ use)
    return Key(mixed & 0xFFFFFFFF, mixed >> 32)


def _mix(x: int) -> int:
    x = ((x ^ (x >> 30)) * 0xBF58476D1CE4E5B9) & _MASK
    x = ((x ^ (x >> 27)) * 0x94D049BB133111EB) & _MASK
    return x ^ (x >> 31)
