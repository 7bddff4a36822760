"""Where a further DAP would tell most of where people are (pure): expected information.

Crews pass where crews have passed. A DAP that stood there would have tied each of those passes to
the others: one that is held to be at a covariance P tells it the more, the larger P is beside R, of
the tie and of where the DAP itself is held to stand. Each pass after the best known one gains
½ log₂ det(I + P R⁻¹) bits, the mutual information of a Gaussian place and its measurement; their
sum is the site's gain. Where nobody came by twice there is nothing to be gained. What was known at
a moment of the past can be asked as well.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Iterable, Iterator
from typing import Protocol, TypeAlias

import msgspec

from shared.messages import LocalPosition

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

Point: TypeAlias = tuple[float, float, float]
Covariance: TypeAlias = tuple[float, float, float]
_CellId: TypeAlias = tuple[int, int, int]


class Site(msgspec.Struct, frozen=True):
    """A place for a DAP (m), what it would tell (bits), and why, in words."""

    north_m: float
    east_m: float
    down_m: float
    gain_bits: float
    reason: str


class Placed(Protocol):
    """As much of an estimate as is looked at: whose it is, where that is, and how surely."""

    @property
    def responder_id(self) -> str:
        """Whose it is."""

    @property
    def north_m(self) -> float:
        """How far north."""

    @property
    def east_m(self) -> float:
        """How far east."""

    @property
    def down_m(self) -> float:
        """How far down."""

    @property
    def covariance_m2(self) -> Covariance:
        """How surely (nn, ne, ee)."""


class _Cell:
    """A stretch of a way: where it is, and when and how surely each pass was known there.

    One thread adds while others look: a pass counts once its time is there, which comes last.
    """

    def __init__(self, track: Placed) -> None:
        self.place_m = (track.north_m, track.east_m, track.down_m)
        self._passes: list[tuple[str, Covariance]] = []
        self._gains_bits: list[float] = []
        self._best: Covariance | None = None
        self._at_ns: list[int] = []

    def add(self, responder_id: str, covariance_m2: Covariance, at_ns: int) -> None:
        """Note a pass; what a DAP here would have told of all passes is kept up with it."""
        if len(self._at_ns) >= MOST_PASSES:
            return
        self._passes.append((responder_id, covariance_m2))
        if self._best is None or _variance(covariance_m2) < _variance(self._best):
            self._best = covariance_m2
            self._gains_bits.append(_gain_bits([each for _, each in self._passes]))
        else:
            self._gains_bits.append(self._gains_bits[-1] + _bits(covariance_m2, _tied(self._best)))
        self._at_ns.append(max(at_ns, self._at_ns[-1]) if self._at_ns else at_ns)

    def gain_bits(self, until_ns: int | None) -> float:
        """Return what a DAP here would have told of the passes by then."""
        count = self._count(until_ns)
        return self._gains_bits[count - 1] if count else 0.0

    def passes(self, until_ns: int | None) -> list[tuple[str, Covariance]]:
        """Return who had passed by then, and how surely that is known."""
        return self._passes[: self._count(until_ns)]

    def _count(self, until_ns: int | None) -> int:
        return len(self._at_ns) if until_ns is None else bisect_right(self._at_ns, until_ns)


class Coverage:
    """Takes in tracks as they are published; ranks the places where a DAP would help."""

    def __init__(self) -> None:
        self._cells: dict[_CellId, _Cell] = {}
        self._last: dict[str, _CellId] = {}

    def take(self, track: Placed, at_ns: int = 0) -> None:
        """Note where somebody is, told at ``at_ns``; who stays within a cell has passed it once."""
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
        cell.add(track.responder_id, track.covariance_m2, at_ns)

    def sites(self, daps: Iterable[LocalPosition], until_ns: int | None = None) -> list[Site]:
        """Return the best places, best first, given where DAPs stand; of what was told by then."""
        taken_m = [(dap.north_m, dap.east_m, dap.down_m) for dap in daps]
        standing = len(taken_m)
        told: list[Site] = []
        gains = ((cell.gain_bits(until_ns), cell) for cell in list(self._cells.values()))
        worth = [(gain_bits, cell) for gain_bits, cell in gains if gain_bits >= LEAST_BITS]
        for gain_bits, cell in sorted(worth, key=lambda each: (-each[0], each[1].place_m)):
            if len(told) == MOST_SITES:
                break
            if any(_apart_m(cell.place_m, other) < COVERED_M for other in taken_m):
                continue
            reason = _reason(cell.place_m, cell.passes(until_ns), taken_m[:standing])
            told.append(Site(*cell.place_m, round(gain_bits, 1), reason))
            taken_m.append(cell.place_m)
        return told


def _gain_bits(covariances: list[Covariance]) -> float:
    """Return what a DAP would have told of all passes but the best known."""
    best, *others = sorted(covariances, key=_variance)
    return math.fsum(_bits(each, _tied(best)) for each in others)


def _variance(covariance: Covariance) -> float:
    return covariance[0] + covariance[2]


def _tied(best: Covariance) -> Covariance:
    """Return how surely a pass is known by a DAP that was tied by the best of them."""
    nn, ne, ee = best
    return (nn + TIE_SD_M**2, ne, ee + TIE_SD_M**2)


def _bits(covariance: Covariance, noise: Covariance) -> float:
    both = [one + other for one, other in zip(covariance, noise, strict=True)]
    return 0.5 * math.log2(max(_det(*both) / _det(*noise), 1.0))


def _det(nn: float, ne: float, ee: float) -> float:
    return nn * ee - ne * ne


def _reason(place_m: Point, passes: list[tuple[str, Covariance]], daps_m: list[Point]) -> str:
    who = {responder_id for responder_id, _ in passes}
    sd_m = _median(math.sqrt(0.5 * (nn + ee)) for _, (nn, _, ee) in passes)
    nearest_m = min((_apart_m(place_m, dap_m) for dap_m in daps_m), default=None)
    far = "no DAP stands" if nearest_m is None else f"{nearest_m:.0f} m from the nearest DAP"
    return f"passed {len(passes)} times by {len(who)}, known to ±{sd_m:.1f} m there, {far}"


def _median(values: Iterator[float]) -> float:
    ordered = sorted(values)
    return ordered[len(ordered) // 2]


def _apart_m(one: Point, other: Point) -> float:
    """Return how far apart two places are; other storeys are out of reach."""
    if abs(one[2] - other[2]) > CELL_DOWN_M:
        return math.inf
    return math.hypot(one[0] - other[0], one[1] - other[1])
