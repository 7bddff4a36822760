"""One node's block of the normal equations: inverted, carried to the next, and gone back to."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from shared.compiled import compiled

Floats: TypeAlias = NDArray[np.float64]
Ints: TypeAlias = NDArray[np.int64]
Three: TypeAlias = tuple[float, float, float]


@compiled
def wing_of(wing: Floats, wing_at: Ints, a: int) -> Floats:
    """Return what a node has to do with the arrow: a view (3, width)."""
    first, end = wing_at[a], wing_at[a + 1]
    return wing[first:end].reshape(3, (end - first) // 3)


@compiled
def determinant(block: Floats) -> float:
    """Return the determinant of a symmetric (3, 3) ``block``."""
    a, b, c = block[0, 0], block[0, 1], block[0, 2]
    d, e, f = block[1, 1], block[1, 2], block[2, 2]
    found: float = a * (d * f - e * e) + b * (c * e - b * f) + c * (b * e - c * d)
    return found


@compiled
def invert_block(node: Floats, a: int, inverse: Floats) -> None:
    """Write the inverse of a node's symmetric block, given by its upper triangle."""
    n00, n01, n02 = node[a, 0, 0], node[a, 0, 1], node[a, 0, 2]
    n11, n12, n22 = node[a, 1, 1], node[a, 1, 2], node[a, 2, 2]
    p = n11 * n22 - n12 * n12
    q = n02 * n12 - n01 * n22
    r = n01 * n12 - n02 * n11
    over = 1.0 / (n00 * p + n01 * q + n02 * r)
    inverse[a, 0, 0] = p * over
    inverse[a, 0, 1] = inverse[a, 1, 0] = q * over
    inverse[a, 0, 2] = inverse[a, 2, 0] = r * over
    inverse[a, 1, 1] = (n00 * n22 - n02 * n02) * over
    inverse[a, 1, 2] = inverse[a, 2, 1] = (n01 * n02 - n00 * n12) * over
    inverse[a, 2, 2] = (n00 * n11 - n01 * n01) * over


@compiled
def solved(inverse: Floats, a: int, right: Floats) -> Three:
    """Return a node's inverse times its right side."""
    r0, r1, r2 = right[a, 0], right[a, 1], right[a, 2]
    return (
        inverse[a, 0, 0] * r0 + inverse[a, 0, 1] * r1 + inverse[a, 0, 2] * r2,
        inverse[a, 1, 0] * r0 + inverse[a, 1, 1] * r1 + inverse[a, 1, 2] * r2,
        inverse[a, 2, 0] * r0 + inverse[a, 2, 1] * r1 + inverse[a, 2, 2] * r2,
    )


@compiled
def carry_node(
    node: Floats, link: Floats, inverse: Floats, right: Floats, a: int, onward: int, y: Three
) -> None:
    """Take what node ``a`` knew over to the ``onward`` one, which it is linked with."""
    for row in range(3):
        l0, l1, l2 = link[a, 0, row], link[a, 1, row], link[a, 2, row]
        right[onward, row] -= l0 * y[0] + l1 * y[1] + l2 * y[2]
        f0 = l0 * inverse[a, 0, 0] + l1 * inverse[a, 1, 0] + l2 * inverse[a, 2, 0]
        f1 = l0 * inverse[a, 0, 1] + l1 * inverse[a, 1, 1] + l2 * inverse[a, 2, 1]
        f2 = l0 * inverse[a, 0, 2] + l1 * inverse[a, 1, 2] + l2 * inverse[a, 2, 2]
        for column in range(row, 3):
            node[onward, row, column] -= (
                f0 * link[a, 0, column] + f1 * link[a, 1, column] + f2 * link[a, 2, column]
            )


@compiled
def change_node(
    link: Floats, inverse: Floats, a: int, onward: int, rest: Three, change: Floats
) -> None:
    """Write a node's row of ``change`` from the next one's, and what its columns leave."""
    rest0, rest1, rest2 = rest
    for k in range(3):
        rest0 -= link[a, 0, k] * change[onward, k]
        rest1 -= link[a, 1, k] * change[onward, k]
        rest2 -= link[a, 2, k] * change[onward, k]
    for row in range(3):
        i0, i1, i2 = inverse[a, row, 0], inverse[a, row, 1], inverse[a, row, 2]
        change[a, row] = i0 * rest0 + i1 * rest1 + i2 * rest2


@compiled
def times_inverse(inverse: Floats, a: int, wing: Floats, share: Floats) -> None:
    """Write a node's inverse times its wing (3, width) into the first columns of ``share``."""
    for row in range(3):
        i0, i1, i2 = inverse[a, row, 0], inverse[a, row, 1], inverse[a, row, 2]
        for column in range(wing.shape[1]):
            share[row, column] = i0 * wing[0, column] + i1 * wing[1, column] + i2 * wing[2, column]
