"""How long a step is, by how much the body bounces."""

from __future__ import annotations

import math

WEINBERG_K = 0.48
"""Metres at a range of 1 m/s², of nobody in particular."""


def weinberg_m(highest_m_s2: float, lowest_m_s2: float, k: float = WEINBERG_K) -> float:
    """Return the length of a step between whose extremes specific force went, K·(Pmax − Pmin)^¼.

    Weinberg, "Using the ADXL202 in pedometer and personal navigation applications" (2002): the
    body is a stiff leg's height over its foot, and K a constant of the person.
    """
    return k * float((highest_m_s2 - lowest_m_s2) ** 0.25)


BOUNCE_K = 0.46
"""Metres at a mean bounce of 1 m/s²: one for everybody, a person's own being some 5 % off."""

LONGEST_STEP_M = 2.0


def bounce_length_m(mean_m_s2: float, k: float = BOUNCE_K) -> float:
    """Return the length of a step whose vertical force is off its mean by so much, on average.

    Over a stiff leg of length l the body rises by h with L² = 8·l·h (Zijlstra and Hof,
    "Displacement of the pelvis during human walking", 1997), and at a person's usual cadence h is
    in proportion to the force: L = K·√mean. The mean minds no single sample (Kim et al., 2004);
    their cube root, and Weinberg's fourth, tell slow steps too long.
    """
    return min(k * math.sqrt(mean_m_s2), LONGEST_STEP_M)
