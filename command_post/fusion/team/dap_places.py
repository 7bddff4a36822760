"""Where the DAPs stand, from a solved team (pure)."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from command_post.fusion.dap_map import InstalledDap
from command_post.fusion.team.height_assembly import Heights
from command_post.fusion.team.log import Installed, TeamLog
from command_post.fusion.team.solving import Solved
from command_post.fusion.team.ties import level_sd_m
from command_post.fusion.track import MOST_COORDINATE_M, told_covariance, within
from shared.messages import LocalPosition

FOUND_SD_M = 100.0
"""A place that nobody has passed yet is not told."""


def daps_of(log: TeamLog, solved: Solved, heights: Heights) -> dict[str, InstalledDap]:
    """Return each DAP where it was set down last, by id; none that lies nobody knows where."""
    newest: dict[str, tuple[int, int]] = {}
    for place, place_id in enumerate(solved.assembled.places):
        if place_id[0] == "dap":
            dap_id, set_down = place_id[1], (int(place_id[2]), place)
            newest[dap_id] = max(newest.get(dap_id, set_down), set_down)
    found = {}
    for dap_id, (installed_ns, place) in newest.items():
        installed = next(each for each in log.daps[dap_id] if each.time_ns == installed_ns)
        position = position_of(solved, heights, place)
        if installed.found and level_sd_m(position) > FOUND_SD_M:
            continue
        found[dap_id] = InstalledDap(
            position,
            installed_ns if installed.said_ns is None else installed.said_ns,
            installed.installer_id,
        )
    return found


def places_of(
    solved: Solved, heights: Heights, owned: Collection[str]
) -> dict[str, tuple[Installed, ...]]:
    """Return where DAPs stood since when, as other crews may take it: of those ``owned``."""
    found: dict[str, tuple[Installed, ...]] = {}
    for place, place_id in enumerate(solved.assembled.places):
        if place_id[0] == "dap" and place_id[1] in owned:
            dap_id, installed_ns = place_id[1], int(place_id[2])
            position = position_of(solved, heights, place)
            is_known = bool(solved.assembled.aside_m2[place])
            stood = Installed(installed_ns, None, position, found=not is_known)
            found[dap_id] = (*found.get(dap_id, ()), stood)
    return {dap_id: tuple(sorted(stood, key=_since)) for dap_id, stood in found.items()}


def _since(installed: Installed) -> int:
    return installed.time_ns


def position_of(solved: Solved, heights: Heights, place: int) -> LocalPosition:
    """Return where a place is in a solution, and how surely.

    Of one that was known it is passed aside of where it stands: by how much is known from both.
    """
    assembled = solved.assembled
    column = assembled.place_column(place)
    passed_m = solved.arrow[column : column + 2]
    passed_m2 = solved.shared[column : column + 2, column : column + 2]
    known_m, known_sd_m = assembled.graph.place[place, :2], assembled.graph.place[place, 2]
    aside_m2 = assembled.aside_m2[place]
    share = 1.0 - aside_m2 / known_sd_m**2
    north_m, east_m = (known_m + share * (passed_m - known_m)).tolist()
    (nn, ne), (_, ee) = (share**2 * passed_m2 + share * aside_m2 * np.eye(2)).tolist()
    return LocalPosition(
        north_m=within(north_m, MOST_COORDINATE_M),
        east_m=within(east_m, MOST_COORDINATE_M),
        down_m=within(float(heights.place_m[place]), MOST_COORDINATE_M),
        covariance_m2=told_covariance(nn, ne, ee),
    )


def apart_m(one: LocalPosition, other: LocalPosition) -> float:
    """Return how far apart two places are, along the axis where that is most."""
    return max(
        abs(one.north_m - other.north_m), abs(one.east_m - other.east_m),
        abs(one.down_m - other.down_m),
    )  # fmt: skip
