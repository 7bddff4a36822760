"""Sine, cosine, logarithm and Cholesky of our own, for the same bits on every machine.

A mathematical library picks its code by the processor it finds, and two of them may differ in the
last bit. These use nothing but sums, products, quotients and square roots in a fixed order, which
IEEE 754 rounds alike everywhere.
"""

from __future__ import annotations

import math
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from shared.compiled import compiled
from shared.maths.angles import nearest_right_angle_rad

Floats: TypeAlias = NDArray[np.float64]

# π/2 in three parts, so that whole multiples of it subtract without rounding (Cody and Waite).
_HALF_PI_HIGH = 1.5707963267341256
_HALF_PI_MIDDLE = 6.077100506303966e-11
_HALF_PI_LOW = 2.0222662487959506e-21
_TWO_OVER_PI = 2.0 / math.pi
_LN_2_HIGH = 6.93147180369123816490e-01
_LN_2_LOW = 1.90821492927058770002e-10

nearest_right_angle = compiled(nearest_right_angle_rad)


@compiled
def sine_cosine(angle_rad: float) -> tuple[float, float]:
    """Return sine and cosine, to 1e-15 for angles of up to some thousand turns.

    Taylor's series about zero, to where the next term is below half a unit in the last place at
    π/4.
    """
    quarter = math.floor(angle_rad * _TWO_OVER_PI + 0.5)
    x = angle_rad - quarter * _HALF_PI_HIGH
    x -= quarter * _HALF_PI_MIDDLE
    x -= quarter * _HALF_PI_LOW
    y = x * x
    sine = x * (1.0 - y / 6.0 * (1.0 - y / 20.0 * (1.0 - y / 42.0 * (1.0 - y / 72.0 * (
        1.0 - y / 110.0 * (1.0 - y / 156.0 * (1.0 - y / 210.0)))))))  # fmt: skip
    cosine = 1.0 - y / 2.0 * (1.0 - y / 12.0 * (1.0 - y / 30.0 * (1.0 - y / 56.0 * (
        1.0 - y / 90.0 * (1.0 - y / 132.0 * (1.0 - y / 182.0 * (1.0 - y / 240.0)))))))  # fmt: skip
    turn = int(quarter) & 3
    if turn == 0:
        return sine, cosine
    if turn == 1:
        return cosine, -sine
    if turn == 2:
        return -sine, -cosine
    return -cosine, sine


@compiled
def rotated(angle_rad: float, north: float, east: float) -> tuple[float, float]:
    """Return a vector turned clockwise."""
    sine, cosine = sine_cosine(angle_rad)
    return cosine * north - sine * east, sine * north + cosine * east


@compiled
def carried(pose: Floats, north: float, east: float) -> tuple[float, float]:
    """Return the place reached from a ``pose`` (north, east, turn) by a way in its own frame."""
    sine, cosine = sine_cosine(pose[2])
    return pose[0] + cosine * north - sine * east, pose[1] + sine * north + cosine * east


@compiled
def logarithm(number: float) -> float:
    """Return the natural logarithm of a positive normal ``number``, to 1e-15.

    ln(m·2ᵉ) with m within √2 of one, by the series of artanh((m - 1)/(m + 1)).
    """
    mantissa, exponent = math.frexp(number)
    if mantissa < 0.7071067811865476:
        mantissa *= 2.0
        exponent -= 1
    s = (mantissa - 1.0) / (mantissa + 1.0)
    y = s * s
    series = 1.0 / 21.0
    for power in range(19, 0, -2):
        series = series * y + 1.0 / power
    return exponent * _LN_2_HIGH + (2.0 * s * series + exponent * _LN_2_LOW)


@compiled
def factorise(matrix: Floats) -> bool:
    """Overwrite the lower triangle of ``matrix`` (n, n) with its Cholesky factor L, A = L·Lᵀ.

    ``False``, with the matrix spoilt, if it is not positive definite. Only the lower triangle is
    read.
    """
    n = matrix.shape[0]
    # Column by column, what each leaves taken from whole rows at once: of a sum by itself every
    # term would wait for the one before. They come in the same order.
    for k in range(n):
        if not matrix[k, k] > 0.0:
            return False
        matrix[k, k] = math.sqrt(matrix[k, k])
        column = matrix[k + 1 :, k] / matrix[k, k]
        matrix[k + 1 :, k] = column
        for below in range(column.size):
            weight, row = column[below], matrix[k + 1 + below, k + 1 :]
            for each in range(below + 1):
                row[each] -= weight * column[each]
    return True


@compiled
def solve_factorised(factor: Floats, vector: Floats) -> None:
    """Overwrite ``vector`` (n,) with A⁻¹ times it, from the factor of A."""
    n = factor.shape[0]
    for row in range(n):
        total = vector[row]
        for k in range(row):
            total -= factor[row, k] * vector[k]
        vector[row] = total / factor[row, row]
    for row in range(n - 1, -1, -1):
        total = vector[row]
        for k in range(row + 1, n):
            total -= factor[k, row] * vector[k]
        vector[row] = total / factor[row, row]


@compiled
def _inverse_of(factor: Floats) -> Floats:
    """Return L⁻¹ (n, n), lower triangular."""
    n = factor.shape[0]
    lower = np.zeros((n, n))
    for row in range(n):
        for k in range(row):
            weight = factor[row, k]
            for column in range(k + 1):
                lower[row, column] -= weight * lower[k, column]
        for column in range(row):
            lower[row, column] /= factor[row, row]
        lower[row, row] = 1.0 / factor[row, row]
    return lower


@compiled
def invert_factorised(factor: Floats) -> Floats:
    """Return A⁻¹ (n, n), exactly symmetric, from the factor of A."""
    n = factor.shape[0]
    lower = _inverse_of(factor)
    inverse = np.zeros((n, n))
    for k in range(n):
        for row in range(k + 1):
            weight = lower[k, row]
            if weight != 0.0:
                for column in range(row + 1):
                    inverse[row, column] += weight * lower[k, column]
    for row in range(n):
        for column in range(row):
            inverse[column, row] = inverse[row, column]
    return inverse


def exponential(number: float) -> float:
    """Return e to the power of ``number``, from -20 to 0 to 1e-12 of it; nought of what is less.

    A thousandth part of it by its series, squared ten times over: a library's bits may differ.
    """
    if number < -20.0:
        return 0.0
    part = number / 1024.0
    power = 1.0
    for divisor in range(6, 0, -1):
        power = 1.0 + part / divisor * power
    for _ in range(10):
        power *= power
    return power
