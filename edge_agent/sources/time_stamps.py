"""Time stamps as recorders write them, and what they ought to be.

A program that logs a sensor stamps samples when they arrive: several at once, or one twice. The
sensor itself samples evenly, at a rate that is not quite the one in its data sheet (one sold as
400 Hz ran at 397.7), so the rate is taken from the stamps, never from a nominal figure.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from edge_agent.sources.recording import Array

LONGEST_PAUSE_S = 0.5
"""Across a longer one the sensor was not sampling, and each side is fitted by itself."""


class Repaired(NamedTuple):
    """``rows`` (m,) that are samples of their own, and ``time_s`` (m,) of each."""

    rows: np.ndarray[tuple[int], np.dtype[np.int64]]
    time_s: Array


def repaired(time_s: Array, readings: Array) -> Repaired:
    """Drop repeated rows and spread bursts, of stamps (n,) and readings (n, k).

    A row like the one before in stamp and readings was sent twice, and goes. If stamps still
    repeat, the readings came in bursts: times become the straight line of stamp over row, by least
    squares over each stretch without a pause. Stamps that never repeat are left as they are.
    """
    repeated = np.zeros(len(time_s), dtype=bool)
    same_readings = (readings[1:] == readings[:-1]).all(axis=1)
    repeated[1:] = same_readings & (time_s[1:] == time_s[:-1])
    rows = np.flatnonzero(~repeated)
    kept_s = time_s[rows]
    if np.all(np.diff(kept_s) != 0.0):
        return Repaired(rows, kept_s)
    pauses = np.flatnonzero(np.abs(np.diff(kept_s)) > LONGEST_PAUSE_S) + 1
    stretches = np.split(kept_s, pauses)
    return Repaired(rows, np.concatenate([_evenly(stretch) for stretch in stretches]))


def _evenly(stamps_s: Array) -> Array:
    """Return the line through ``stamps_s`` over their index; one stamp alone stays."""
    index = np.arange(len(stamps_s), dtype=np.float64)
    if len(stamps_s) < 2:
        return stamps_s
    centred = index - index.mean()
    period_s = float(centred @ stamps_s / (centred @ centred))
    line_s: Array = stamps_s.mean() + period_s * centred
    return line_s
