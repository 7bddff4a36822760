"""Random numbers and elementary functions for one lane of a cloud, and the sum across its lanes.

Compilers turn a loop of these over 64 neighbouring numbers into vector code, for they hold nothing
but sums, products, quotients, square roots and whole-number bits. IEEE 754 rounds those alike in
every vector width, and no mathematical library, which may not, is asked. Numbers must stay 32 bits
wide: a bare ``0.5`` would make numba reckon in double precision, and any uint32 expression widens
to 64 bits unless each step is cast back.
"""

from __future__ import annotations

import math

import numpy as np

from command_post.fusion.cloud.layout import SUM_LANES, Lanes, Sums
from shared.compiled import compiled

f32 = np.float32
u32 = np.uint32
i32 = np.int32

ZERO, HALF, ONE, TWO = f32(0.0), f32(0.5), f32(1.0), f32(2.0)
PI, TURN = f32(math.pi), f32(2.0 * math.pi)

_BYTE_BITS, _EVERY_OTHER_BYTE, _BOTH_PAIRS = u32(8), u32(0x00FF00FF), u32(0x00010001)
_WORD_BITS = u32(16)
_FIFTEEN, _FIRST_FACTOR, _SECOND_FACTOR = u32(15), u32(0x21F0AAAD), u32(0xD35A2D97)
_MIDDLE_OF_BYTES = i32(510)
_GAUSS_LINEAR, _GAUSS_CUBIC = f32(6.42104061e-3), f32(5.77395428e-9)

# ln 2 in parts, of which the low bits of the first are nought, so that small multiples of it are
# exact (Cody and Waite 1980).
_LN_2_HIGH = f32(0.693359375)
_LN_2_LOW = f32(math.log(2.0) - 0.693359375)
_POWERS_OF_2 = f32(1.0 / math.log(2.0))

_SHIFT_UP, _SHIFT = f32(128.5), i32(128)
LEAST_EXPONENT, LEAST_WEIGHT = f32(-40.0), f32(math.exp(-40.0))
_ROOT_HALF_BITS = u32(0x3F3504F3)
_MANTISSA_BITS, _EXPONENT_BIAS = i32(23), i32(127)

# Coefficients of least largest error, found by reweighted least squares:
# sin x = x + x³·S(x²) and cos x = 1 - x²/2 + x⁴·C(x²) within ±π/2, eˣ = 1 + x + x²·E(x) within
# ±ln 2 / 2, ln(1 + x) = x - x²/2 + x³·L(x) from √½ - 1 to √2 - 1.
_S0, _S1, _S2, _S3 = f32(-0.166666597), f32(0.0083330879), f32(-1.98111011e-4), f32(2.60890306e-6)
_C0, _C1, _C2, _C3 = f32(0.0416666567), f32(-1.38885691e-3), f32(2.47692915e-5), f32(-2.61935384e-7)
_E0, _E1, _E2, _E3 = f32(0.499990076), f32(0.166664228), f32(0.0419165678), f32(0.0083779078)
_L0, _L1, _L2, _L3 = f32(0.333338588), f32(-0.250017464), f32(0.199653983), f32(-0.165656343)
_L4, _L5, _L6 = f32(0.148769617), f32(-0.143502012), f32(0.0891786814)


@compiled
def random_bits(counter: np.uint32, key_low: np.uint32, key_high: np.uint32) -> np.uint32:
    """Return 32 random bits for a ``counter`` under a key of two words.

    Two rounds of multiplying and folding (Wellons, "Prospecting for hash functions"); one word of
    the key is put in before the first, the other between them, so that no two keys give one
    another's numbers shifted.
    """
    x = u32(counter + key_low)
    x = u32(x ^ u32(x >> _WORD_BITS))
    x = u32(x * _FIRST_FACTOR)
    x = u32(x ^ key_high)
    x = u32(x ^ u32(x >> _FIFTEEN))
    x = u32(x * _SECOND_FACTOR)
    return u32(x ^ u32(x >> _FIFTEEN))


@compiled
def gaussian(bits: np.uint32) -> np.float32:
    """Return a standard normal number of a random word's four bytes, within ±4.05.

    Their sum is nearly normal, but short of tails; a cubic (Cornish and Fisher 1938) gives it the
    variance 1 and the fourth moment 3 exactly. No quantile is off by more than 0.2 %.
    """
    pairs = u32(u32(bits & _EVERY_OTHER_BYTE) + u32(u32(bits >> _BYTE_BITS) & _EVERY_OTHER_BYTE))
    x = f32(i32(i32(u32(pairs * _BOTH_PAIRS) >> _WORD_BITS) - _MIDDLE_OF_BYTES))
    return x * (_GAUSS_LINEAR + _GAUSS_CUBIC * (x * x))


@compiled
def sine_cosine(angle_rad: np.float32) -> tuple[np.float32, np.float32]:
    """Return sine and cosine of an angle within ±π, to 4e-7, by those of its half."""
    x = HALF * angle_rad
    y = x * x
    sine = x + x * y * (_S0 + y * (_S1 + y * (_S2 + y * _S3)))
    cosine = ONE - y * (HALF - y * (_C0 + y * (_C1 + y * (_C2 + y * _C3))))
    return TWO * sine * cosine, (cosine - sine) * (cosine + sine)


@compiled
def natural_log(number: np.float32) -> np.float32:
    """Return ln of a positive normal ``number``: ln(m·2ᵉ), m within √2 of one, to 1.2e-7."""
    bits = f32(number).view(np.uint32)
    exponent = i32(i32(u32(bits - _ROOT_HALF_BITS)) >> _MANTISSA_BITS)
    x = u32(bits - u32(exponent << _MANTISSA_BITS)).view(np.float32) - ONE
    series = _L0 + x * (_L1 + x * (_L2 + x * (_L3 + x * (_L4 + x * (_L5 + x * _L6)))))
    e = f32(exponent)
    return e * _LN_2_HIGH + (x - (x * x * (HALF - x * series) - e * _LN_2_LOW))


@compiled
def exponential(number: np.float32) -> np.float32:
    """Return eˣ for x up to 87, to 2e-7; below -40 as if it were that: as good as nought.

    Weights are squared; were they smaller, processors would take a hundred times as long over them.
    """
    x = max(number, LEAST_EXPONENT)
    power = i32(i32(x * _POWERS_OF_2 + _SHIFT_UP) - _SHIFT)
    count = f32(power)
    r = (x - count * _LN_2_HIGH) - count * _LN_2_LOW
    scale = u32((power + _EXPONENT_BIAS) << _MANTISSA_BITS).view(np.float32)
    return (ONE + r + r * r * (_E0 + r * (_E1 + r * (_E2 + r * _E3)))) * scale


@compiled
def bearing(east: float, north: float) -> float:
    """Return the angle clockwise from north of a direction, in (-π, π], in double precision.

    The angle is halved three times, tan(θ/2) = tan θ / (1 + √(1 + tan² θ)), to where Taylor's
    series of arctan is short.
    """
    across, along = abs(east), abs(north)
    larger, smaller = max(across, along), min(across, along)
    if larger == 0.0:
        return 0.0
    t = smaller / larger
    for _ in range(3):
        t = t / (1.0 + math.sqrt(1.0 + t * t))
    y = t * t
    series = 0.0
    for power in range(17, 0, -2):
        series = 1.0 / power - y * series
    angle = 8.0 * t * series
    if across > along:
        angle = 0.5 * math.pi - angle
    if north < 0.0:
        angle = math.pi - angle
    return angle if east >= 0.0 else -angle


@compiled
def across(sums: Lanes, totals: Sums) -> None:
    """Write to ``totals`` (n,) the sums of SUM_LANES ``sums`` each, which are spoilt.

    They are folded in half once and then added up in double precision.
    """
    for row in range(totals.size):
        o = row * SUM_LANES
        for lane in range(SUM_LANES // 2):
            sums[o + lane] += sums[o + lane + SUM_LANES // 2]
        total = 0.0
        for lane in range(SUM_LANES // 2):
            total += sums[o + lane]
        totals[row] = total
