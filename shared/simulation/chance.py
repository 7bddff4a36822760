"""Every random number of an exercise comes from here, from its seed and what it is for."""

from __future__ import annotations

from zlib import crc32

import numpy as np


def generator(seed: int, *purpose: str) -> np.random.Generator:
    """Return the stream of random numbers that ``purpose`` has in the exercise of ``seed`` (≥ 0).

    The same arguments give the same numbers in every process, so that a DAP and a responder who
    both work out a walk work out the same one. Philox is counter-based: streams do not overlap.
    """
    words = [crc32(word.encode()) for word in purpose]
    return np.random.Generator(np.random.Philox(np.random.SeedSequence([seed, *words])))
