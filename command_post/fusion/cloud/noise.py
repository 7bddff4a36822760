"""Tables of normal numbers and of chances: to read one is far less work than to make one.

Whoever needs numbers for a block of particles reads a run of neighbours from a place that its key
tells. Every number of the table is as likely for each, as they stand in no order, and where one
step reads tells nothing of where another does.
"""

from __future__ import annotations

import math
from hashlib import shake_128
from statistics import NormalDist
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from command_post.fusion.cloud.layout import LANES, Lanes
from shared.compiled import compiled

Floats: TypeAlias = NDArray[np.floating]

PLACES = 8192
CHANCES = 65536

_GRAINS = 2.0**16
_PLACE, _PLACE_BITS = np.uint32(PLACES - 1), np.uint32(13)


def _normal() -> Floats:
    """Return PLACES standard normal numbers: the middles of as many equal shares, lowest first.

    Their mean is nought and their variance 1. They are rounded to what any mathematical library
    makes alike of them.
    """
    shares = (np.arange(PLACES // 2, PLACES) + 0.5) / PLACES
    upper = np.array([NormalDist().inv_cdf(share) for share in shares.tolist()])
    sd = math.sqrt(math.fsum((upper * upper).tolist()) / upper.size)
    upper = np.rint(upper / sd * _GRAINS) / _GRAINS
    return np.concatenate([-upper[::-1], upper])


def _shuffled(numbers: Floats, name: bytes) -> Lanes:
    """Return numbers in an order of no pattern, the first of them once more at the end."""
    words = np.frombuffer(shake_128(name).digest(4 * PLACES), "<u4")
    order = np.argsort(words, kind="stable")
    shuffled: Lanes = numbers[np.concatenate([order, order[:LANES]])].astype(np.float32)
    return shuffled


NORMAL = _shuffled(_normal(), b"normal")
"""(PLACES + LANES,): whatever place below PLACES a run of LANES begins at, it has one."""

CHANCE = _shuffled((np.arange(PLACES) + 0.5) * (CHANCES / PLACES), b"chance")
"""Likewise, evenly from nought to CHANCES."""


@compiled
def two_places(word: np.uint32) -> tuple[int, int]:
    """Return where to begin to read, twice, of a random word: its lowest 13 bits and the next."""
    return int(word & _PLACE), int((word >> _PLACE_BITS) & _PLACE)
