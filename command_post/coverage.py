"""Where a further DAP would tell most of where people are (pure): expected information.

Crews pass where crews have passed. A DAP that stood there would have tied each of those passes to
the others: one that is held to be at a covariance P tells it the more, the larger P is beside R, of
the tie and of where the DAP itself is held to stand. Each pass after the best known one gains
½ log₂ det(I + P R⁻¹) bits, the mutual information of a Gaussian place and its measurement; their
sum is the site's gain. Where nobody came by twice there is nothing to be gained.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from typing import TypeAlias

import msgspec

from shared.messages import LocalPosition, TrackEstimate

CELL_M = 3.0
CELL_DOWN_M = 2.0
TIE_SD_M = 1.0
"""How near a DAP puts who passes it, and as well passes within a cell are told apart."""

COVERED_M = 8.0
"""So near a DAP that stands, or a better site, no further one is told."""

MOST_SITES = 3
MOST_CELLS = 4096
MOST_PASSES = 64
LEAST_BITS = 1.0

Covariance: TypeAlias = tuple[float, float, float]
_CellId: TypeAlias = tuple[int, int, int]


class Site(msgspec.Struct, frozen=True):
    """A place for a DAP (m), what it would tell (bits), and why, in words."""

    north_m: float
    east_m: float
    down_m: float
    gain_bits: float
    reason: str


class _Cell:
    """A stretch of a way: where it is, and how surely each pass was known there (nn, ne, ee)."""

    def __init__(self, track: TrackEstimate) -> None:
        self.place_m = (track.north_m, track.east_m, track.down_m)
        self.passes: list[tuple[str, Covariance]] = []
        self.gain_bits = 0.0

    def add(self, responder_id: str, covariance_m2: Covariance) -> None:
        """Note a pass; what a DAP here would have told of all passes is kept up with it."""
        if len(self.passes) < MOST_PASSES:
            self.passes.append((responder_id, covariance_m2))
            self.gain_bits = _gain_bits([each for _, each in self.passes])


class Coverage:
    """Takes in tracks as they are published; ranks the places where a DAP would help."""

    def __init__(self) -> None:
        self._cells: dict[_CellId, _Cell] = {}
        self._last: dict[str, _CellId] = {}

    def take(self, track: TrackEstimate) -> None:
        """Note where somebody is; who stays within a cell has passed it once."""
        at = (
            math.floor(track.north_m / CELL_M),
            math.floor(track.east_m / CELL_M),
            round(track.down_m / CELL_DOWN_M),
        )
        if self._last.get(track.responder_id) == at:
            return
        self._last[track.responder_id] = at
        if at not in self._cells and len(self._cells) >= MOST_CELLS:
            return
        cell = self._cells.setdefault(at, _Cell(track))
        cell.add(track.responder_id, track.covariance_m2)

    def sites(self, daps: Iterable[LocalPosition]) -> list[Site]:
        """Return the best places, best first, given where DAPs stand."""
        taken_m = [(dap.north_m, dap.east_m, dap.down_m) for dap in daps]
        standing = len(taken_m)
        told: list[Site] = []
        worth = [cell for cell in self._cells.values() if cell.gain_bits >= LEAST_BITS]
        for cell in sorted(worth, key=lambda each: (-each.gain_bits, each.place_m)):
            if len(told) == MOST_SITES:
                break
            if any(_apart_m(cell.place_m, other) < COVERED_M for other in taken_m):
                continue
            reason = _reason(cell, taken_m[:standing])
            told.append(Site(*cell.place_m, round(cell.gain_bits, 1), reason))
            taken_m.append(cell.place_m)
        return told


def _gain_bits(covariances: list[Covariance]) -> float:
    """Return what a DAP would have told of all passes but the best known."""
    covariances = sorted(covariances, key=lambda each: each[0] + each[2])
    (nn, ne, ee), tie_m2 = covariances[0], TIE_SD_M**2
    installed = (nn + tie_m2, ne, ee + tie_m2)
    return math.fsum(_bits(each, installed) for each in covariances[1:])


def _bits(covariance: Covariance, noise: Covariance) -> float:
    both = [one + other for one, other in zip(covariance, noise, strict=True)]
    return 0.5 * math.log2(max(_det(*both) / _det(*noise), 1.0))


def _det(nn: float, ne: float, ee: float) -> float:
    return nn * ee - ne * ne


def _reason(cell: _Cell, daps_m: list[tuple[float, float, float]]) -> str:
    who = {responder_id for responder_id, _ in cell.passes}
    sd_m = _median(math.sqrt(0.5 * (nn + ee)) for _, (nn, _, ee) in cell.passes)
    nearest_m = min((_apart_m(cell.place_m, dap_m) for dap_m in daps_m), default=None)
    far = "no DAP stands" if nearest_m is None else f"{nearest_m:.0f} m from the nearest DAP"
    return f"passed {len(cell.passes)} times by {len(who)}, known to ±{sd_m:.1f} m there, {far}"


def _median(values: Iterator[float]) -> float:
    ordered = sorted(values)
    return ordered[len(ordered) // 2]


def _apart_m(one: tuple[float, float, float], other: tuple[float, float, float]) -> float:
    """Return how far apart two places are; other storeys are out of reach."""
    if abs(one[2] - other[2]) > CELL_DOWN_M:
        return math.inf
    return math.hypot(one[0] - other[0], one[1] - other[1])
