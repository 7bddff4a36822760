"""How long a step is, by how much the body bounces."""

from __future__ import annotations

WEINBERG_K = 0.48
"""Metres at a range of 1 m/s², of nobody in particular."""


def weinberg_m(highest_m_s2: float, lowest_m_s2: float, k: float = WEINBERG_K) -> float:
    """Return the length of a step between whose extremes specific force went, K·(Pmax − Pmin)^¼.

    Weinberg, "Using the ADXL202 in pedometer and personal navigation applications" (2002): the
    body is a stiff leg's height over its foot, and K a constant of the person.
    """
    return k * float((highest_m_s2 - lowest_m_s2) ** 0.25)
