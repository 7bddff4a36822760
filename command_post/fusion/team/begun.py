"""A team that is begun from where everybody was told to be, in place of all heard before (pure).

Each way begins as if its unit were switched on there, turned as it was told to be turned, and as
surely; DAPs stand where they were told to. How these depended on each other is lost, as it is where
a crew is anchored (``anchors``).
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from command_post.fusion.dap_map import InstalledDap
from command_post.fusion.interface import WayTold
from command_post.fusion.team.crews import Bonds
from command_post.fusion.team.estimates import Pose
from command_post.fusion.team.height_assembly import LEAST_SD_M
from command_post.fusion.team.log import Installed, Start, TeamLog
from command_post.fusion.team.settings import TeamSettings
from command_post.fusion.team.silences import least_quiet_ns
from command_post.fusion.team.suspicions import UNKNOWN_HEADING_SD_RAD
from command_post.fusion.track import told_covariance
from shared.messages import LocalPosition

NOT_TOLD_RAD = 1.5
"""A unit that may be turned by so much, give or take, may be turned any way."""


def begin(
    log: TeamLog, bonds: Bonds, ways: Mapping[str, WayTold], daps: Mapping[str, InstalledDap],
    settings: TeamSettings,
) -> dict[str, Pose]:  # fmt: skip
    """Have ``log`` and ``bonds`` begin from what was told; return everybody's pose by that."""
    for dap_id, dap in daps.items():
        log.daps[dap_id] = [Installed(dap.installed_ns, None, dap.position)]
    for name, way in ways.items():
        own = log.of(name)
        own.starts = [_start(way, settings)]
        own.known.add(way.told.time_ns, least_quiet_ns(settings))
        own.near_ns = way.told.last_proximity_time_ns
        bonds.note_began(name, way.told.time_ns)
    return {name: _pose(way, settings) for name, way in ways.items()}


def _own_covariance(way: WayTold, settings: TeamSettings) -> tuple[float, float, float]:
    """Return a place's covariance as the solution has it: what is told is wider by a factor."""
    nn, ne, ee = (each / settings.covariance_factor for each in way.told.covariance_m2)
    return nn, ne, ee


def _down_sd_m(way: WayTold) -> float:
    return max(way.told.down_sd_m or 0.0, LEAST_SD_M)


def _start(way: WayTold, settings: TeamSettings) -> Start:
    told = way.told
    is_told = told.heading_sd_rad < NOT_TOLD_RAD
    position = LocalPosition(
        north_m=told.north_m, east_m=told.east_m, down_m=told.down_m,
        covariance_m2=told_covariance(*_own_covariance(way, settings)),
    )  # fmt: skip
    return Start(
        told.time_ns, 0, told.heading_sd_rad if is_told else UNKNOWN_HEADING_SD_RAD, position,
        is_loose=way.is_loose, turn_rad=way.turn_rad, down_sd_m=_down_sd_m(way),
        tied_ns=told.last_proximity_time_ns,
    )  # fmt: skip


def _pose(way: WayTold, settings: TeamSettings) -> Pose:
    told = way.told
    nn, ne, ee = _own_covariance(way, settings)
    turn_rad2 = min(told.heading_sd_rad, math.pi) ** 2
    tied_ns = told.time_ns if told.last_proximity_time_ns is None else told.last_proximity_time_ns
    return Pose(
        told.time_ns, told.north_m, told.east_m, way.turn_rad, 0.0,
        (nn, ne, ee, turn_rad2, 0.0, 0.0), (told.down_m, _down_sd_m(way) ** 2),
        0, told.time_ns, tied_ns, told.heading_sd_rad < NOT_TOLD_RAD,
    )  # fmt: skip
