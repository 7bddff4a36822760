"""Backward pass over one stride: the modified Bryson–Frazier smoother, without any inverse.

Bierman 1973, "Fixed interval smoothing with discrete measurements". It gives what Rauch, Tung and
Striebel's smoother gives, but an adjoint ``λ`` travels back, through ``(I − K·H)ᵀ`` at every scalar
update and through ``Fᵀ`` between samples, both sparse: ``x_smoothed = x_filtered − P·λ``.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from edge_agent.inertial.zupt_filter import STATES
from shared.compiled import compiled

# Columns of a row of history: what the backward pass asks of one sample.
TRANSITION = 0  # dt; dt·f_nav (3); −dt·nav_from_body (9)
FILTERED = 13  # position (3), quat_wxyz (4)
COVARIANCE_ROWS = 20  # rows of P of position (3) and heading
UPDATE_COUNT = COVARIANCE_ROWS + 4 * STATES
UPDATES = UPDATE_COUNT + 1  # each: state, height factor, innovation / variance, gain
UPDATE_WIDTH = 3 + STATES
MOST_UPDATES = 6
HISTORY_WIDTH = UPDATES + MOST_UPDATES * UPDATE_WIDTH

Array = NDArray[np.float64]


@compiled
def adjoint_before_update(adjoint: Array, update: Array) -> None:
    """``λ ← (I − K·H)ᵀ·λ − Hᵀ·y/S`` for one scalar update."""
    weight = update[2]
    for i in range(STATES):
        weight += update[3 + i] * adjoint[i]
    adjoint[int(update[0])] -= weight
    adjoint[15] -= update[1] * weight


@compiled
def adjoint_before_transition(adjoint: Array, transition: Array) -> None:
    """``λ ← Fᵀ·λ`` for one sample's transition."""
    dt, x, y, z = transition[0], transition[1], transition[2], transition[3]
    v0, v1, v2 = adjoint[3], adjoint[4], adjoint[5]
    t0, t1, t2 = adjoint[6], adjoint[7], adjoint[8]
    for c in range(3):
        b0, b1, b2 = transition[4 + c], transition[7 + c], transition[10 + c]
        adjoint[9 + c] += b0 * v0 + b1 * v1 + b2 * v2
        adjoint[12 + c] += b0 * t0 + b1 * t1 + b2 * t2
        adjoint[3 + c] += dt * adjoint[c]
    adjoint[6] += y * v2 - z * v1
    adjoint[7] += z * v0 - x * v2
    adjoint[8] += x * v1 - y * v0


@compiled
def smooth_stride(history: Array, path: Array, first: int, last: int) -> None:
    """Smooth slots ``first … last`` with all that was measured in them.

    ``path`` rows become north, east, down (m) and the correction (rad) to the filtered heading.
    """
    mask = history.shape[0] - 1
    adjoint = np.zeros(STATES)
    for slot in range(last, first - 1, -1):
        row = history[slot & mask]
        out = path[slot & mask]
        for c in range(4):
            correction = 0.0
            for i in range(STATES):
                correction -= row[COVARIANCE_ROWS + STATES * c + i] * adjoint[i]
            out[c] = correction + (row[FILTERED + c] if c < 3 else 0.0)
        for u in range(int(row[UPDATE_COUNT]) - 1, -1, -1):
            at = UPDATES + UPDATE_WIDTH * u
            adjoint_before_update(adjoint, row[at : at + UPDATE_WIDTH])
        adjoint_before_transition(adjoint, row)
