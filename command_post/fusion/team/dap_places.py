"""Where the DAPs stand, from a solved team (pure)."""

from __future__ import annotations

from command_post.fusion.dap_map import InstalledDap
from command_post.fusion.team.height_assembly import Heights
from command_post.fusion.team.log import TeamLog
from command_post.fusion.team.solving import Solved
from command_post.fusion.track import MOST_COORDINATE_M, told_covariance, within
from shared.messages import LocalPosition


def daps_of(log: TeamLog, solved: Solved, heights: Heights) -> dict[str, InstalledDap]:
    """Return each DAP where it was set down last, by id."""
    newest: dict[str, tuple[int, int]] = {}
    for place, place_id in enumerate(solved.assembled.places):
        if place_id[0] == "dap":
            dap_id, installed_ns = place_id[1], int(place_id[2])
            newest[dap_id] = max(newest.get(dap_id, (-1, -1)), (installed_ns, place))
    found = {}
    for dap_id, (installed_ns, place) in newest.items():
        column = solved.assembled.place_column(place)
        north_m, east_m = solved.arrow[column : column + 2].tolist()
        (nn, ne), (_, ee) = solved.shared[column : column + 2, column : column + 2].tolist()
        installed = next(each for each in log.daps[dap_id] if each.time_ns == installed_ns)
        found[dap_id] = InstalledDap(
            LocalPosition(
                north_m=within(north_m, MOST_COORDINATE_M),
                east_m=within(east_m, MOST_COORDINATE_M),
                down_m=within(float(heights.place_m[place]), MOST_COORDINATE_M),
                covariance_m2=told_covariance(nn, ne, ee),
            ),
            installed_ns if installed.said_ns is None else installed.said_ns,
            installed.installer_id,
        )
    return found
