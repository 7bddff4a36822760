"""A satellite receiver on a responder: fixes outside the building, and a little way in."""

from __future__ import annotations

from typing import Annotated, NamedTuple, TypeAlias

import msgspec
import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from shared.simulation.plan import Plan

Array: TypeAlias = NDArray[np.float64]
Metres: TypeAlias = Annotated[float, Meta(gt=0.0, le=1000.0)]

BESIDE_WALLS_M = 5.0
"""So far from the building its walls still hide satellites and reflect others."""

VERTICAL = 1.6
"""Heights err by so much more than places."""


class GnssReceiver(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """How well a receiver does: a scenario's ``[gnss]``.

    Under the open sky it errs by ``sd_m`` in each direction, beside the building's walls by up to
    ``worse_beside_walls`` times that; errors fade over ``correlation_s``. Fixes last until the
    wearer is ``until_m`` inside the building's outer walls. The receiver knows its deviation.
    """

    sd_m: Metres = 2.5
    worse_beside_walls: Annotated[float, Meta(ge=1.0, le=20.0)] = 2.5
    correlation_s: Annotated[float, Meta(gt=0.0, le=3600.0)] = 30.0
    until_m: Annotated[float, Meta(ge=0.0, le=1000.0)] = 1.0
    rate_hz: Annotated[float, Meta(gt=0.0, le=20.0)] = 1.0


class Fixes(NamedTuple):
    """Fixes: ``time_s`` (n,), ``position_m`` (n, 3) NED, horizontal deviations ``sd_m`` (n,)."""

    time_s: Array
    position_m: Array
    sd_m: Array


def simulate_fixes(
    receiver: GnssReceiver,
    plan: Plan,
    time_s: Array,
    position_m: Array,
    chance: np.random.Generator,
) -> Fixes:
    """Return the fixes of who is at ``position_m`` (n, 3) NED at ``time_s`` (n,), ascending."""
    outside_m = distance_outside_m(plan, position_m[:, :2])
    beside = np.exp(-np.maximum(outside_m, 0.0) / BESIDE_WALLS_M)
    sd_m = receiver.sd_m * (1.0 + (receiver.worse_beside_walls - 1.0) * beside)
    kept = np.exp(-np.diff(time_s, prepend=time_s[:1]) / receiver.correlation_s)
    fresh = chance.normal(size=(len(time_s), 3))
    error = fresh.copy()
    for now in range(1, len(time_s)):
        error[now] = kept[now] * error[now - 1] + np.sqrt(1.0 - kept[now] ** 2) * fresh[now]
    error_m = error * sd_m[:, None] * [1.0, 1.0, VERTICAL]
    lasts = outside_m > -receiver.until_m
    return Fixes(time_s[lasts], (position_m + error_m)[lasts], sd_m[lasts])


def distance_outside_m(plan: Plan, position_m: Array) -> Array:
    """Return how far outside (n,) ``position_m`` (n, 2) is of the hull of all walls.

    Inside it is negative; without walls that enclose anything it is infinite.
    """
    corners_m = plan.wall_pieces_m.reshape(-1, 2)
    if len(corners_m) == 0 or np.linalg.matrix_rank(corners_m - corners_m.mean(axis=0)) < 2:
        return np.full(len(position_m), np.inf)
    # Few ask how far outside they are, and everybody who simulates anything would load it.
    from scipy.spatial import ConvexHull  # noqa: PLC0415

    sides = ConvexHull(corners_m).equations
    return np.asarray((position_m @ sides[:, :2].T + sides[:, 2]).max(axis=1))
