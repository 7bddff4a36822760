"""From a solved team to what is told of each responder: where, how surely, and why (pure)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from command_post.fusion.team.arithmetic import rotated
from command_post.fusion.team.height_assembly import Heights
from command_post.fusion.team.heights import storey_shares
from command_post.fusion.team.log import END_OF_TIME_NS, ResponderLog
from command_post.fusion.team.settings import TeamSettings
from command_post.fusion.team.silences import is_silent, unheard_m
from command_post.fusion.team.solving import Solved
from command_post.fusion.team.way_since import WaySince
from command_post.fusion.track import MOST_COORDINATE_M, Estimate, told_covariance, within
from shared.maths.angles import wrap_rad
from shared.messages import FloorShare, TrackStatus
from shared.units import NS_PER_S

UNIFORM_TURN_RAD2 = math.pi**2 / 3.0
MOST_FLOORS = 8
LEAST_FLOOR_SHARE = 1e-3
SILENT = "nothing heard"
"""So begins the reason of who is lost for they send nothing."""


class Pose(NamedTuple):
    """A responder as the last tick had them, at their last stance by then.

    ``covariance`` as ``smooth`` gives a node's; ``down`` is height and variance (m, m²). The chain
    goes on in ``unit`` since ``unit_ns``, how that is turned being told by all that it passed if
    ``is_told``; ``tied_ns`` is when something last tied them down. All times are on the unit's own
    clock, which is held to be ahead by ``ahead_ns``. ``by_others`` names who told of them where
    their unit did not.
    """

    time_ns: int
    north_m: float
    east_m: float
    turn_rad: float
    scale: float
    covariance: tuple[float, float, float, float, float, float]
    down: tuple[float, float]
    unit: int
    unit_ns: int
    tied_ns: int
    is_told: bool
    ahead_ns: int = 0
    by_others: str = ""


def pose_of(
    solved: Solved, heights: Heights, index: int, ahead_ns: int, settings: TeamSettings
) -> Pose:
    """Return the last pose of the chain at ``index``."""
    chain = solved.assembled.chains[index]
    end = int(solved.assembled.graph.first[index + 1])
    unit = int(chain.unit[-1])
    north_m, east_m, turn_rad = solved.pose[end - 1].tolist()
    nn, ne, ee, tt, nt, et = solved.end_on_map(index).tolist()
    return Pose(
        int(chain.time_ns[-1]), north_m, east_m, turn_rad,
        float(solved.arrow[solved.assembled.unit_column(index, unit)]),
        (nn, ne, ee, tt, nt, et),
        (float(heights.node_m[end - 1]), float(heights.node_m2[end - 1])),
        unit, chain.starts[unit].time_ns,
        tied_ns(solved, index), solved.tells_turn(index, settings), ahead_ns,
        _others(solved, index) if chain.ends_unheard else "",
    )  # fmt: skip


def _others(solved: Solved, index: int) -> str:
    """Return who told where the chain at ``index`` ends: DAPs, those met, or somebody's word."""
    assembled = solved.assembled
    last = int(assembled.graph.first[index + 1]) - 1
    columns = assembled.graph.tie_at[assembled.graph.tie_at[:, 0] == last, 1]
    places = [assembled.places[(at - assembled.place_column(0)) // 2] for at in columns.tolist()]
    own_id = assembled.chains[index].responder_id
    names = {name for kind, *names in places for name in names[: 1 if kind == "dap" else 2]}
    return ", ".join(sorted(names - {own_id})) or "somebody's word"


def tied_ns(solved: Solved, index: int) -> int:
    """Return when the chain at ``index`` was last tied to a place."""
    graph, chain = solved.assembled.graph, solved.assembled.chains[index]
    first, end = graph.first[index : index + 2].tolist()
    tied = [graph.tie_at[:, 0], graph.fix_at]
    node = max(int(at[(at >= first) & (at < end)].max(initial=first)) for at in tied)
    if node == first and chain.starts[0].tied_ns is not None:
        return chain.starts[0].tied_ns
    return int(chain.time_ns[solved.assembled.nodes[index][node - first]])


def first_pose(log: ResponderLog, settings: TeamSettings) -> Pose:
    """Return where one is put of whom there is no solution yet."""
    starts = log.starts_until(END_OF_TIME_NS)
    start = starts[-1]
    place = next((each.position for each in reversed(starts) if each.position), None)
    north_m, east_m, down_m = (
        (place.north_m, place.east_m, place.down_m) if place else (0.0, 0.0, 0.0)
    )
    sd_m = settings.start_sd_m if place else settings.entrance_sd_m
    turn_rad2 = min(start.heading_sd_rad, math.pi) ** 2
    return Pose(
        start.time_ns, north_m, east_m, 0.0, 0.0, (sd_m**2, 0.0, sd_m**2, turn_rad2, 0.0, 0.0),
        (down_m, settings.start_height_sd_m**2), 0, start.time_ns, start.time_ns, True,
    )  # fmt: skip


def estimate_of(
    pose: Pose, since: WaySince, log: ResponderLog, now_ns: int, storeys_m: Sequence[float],
    settings: TeamSettings,
) -> Estimate:  # fmt: skip
    """Return where a responder is, from the last tick's pose and the way ``since``.

    Nobody knows where one went of whom nothing has been heard: what they may have walked in the
    time until ``now_ns`` is in the covariance.
    """
    dn, de = _moved(pose, since)
    time_ns = since.end_ns
    is_by_others = bool(pose.by_others) and not since.count
    known_ns, seen_ns = log.known.by(now_ns), time_ns - pose.ahead_ns
    silent_s = max(now_ns - (known_ns if is_by_others else max(seen_ns, known_ns)), 0) / NS_PER_S
    unseen_s = max(now_ns - max(seen_ns, known_ns), 0) / NS_PER_S
    is_unheard = is_silent(silent_s, log, settings)
    unheard_m2 = unheard_m(silent_s, unseen_s, log, settings) ** 2 if is_unheard else 0.0
    nn, ne, ee, turn_rad2 = _covariance(pose, since, (dn, de), unheard_m2, settings)
    down_m = pose.down[0] + math.fsum(since.down_m)
    down_m2 = pose.down[1] + max(math.fsum(since.down_m2), 0.0)
    down_sd_m = math.sqrt(max(down_m2, 0.0))
    status, reason = _status(pose, time_ns, (nn, ne, ee), turn_rad2, settings)
    if is_unheard:
        is_lost = unseen_s > settings.silence_s or (is_by_others and status == "lost")
        status = "lost" if is_lost else "dead_reckoning"
        reason = f"{SILENT} for {silent_s:.0f} s"
        if is_by_others:
            reason += f", but by {pose.by_others} {unseen_s:.0f} s ago"
    last = log.moves.last_heading_rad
    return Estimate(
        time_ns=max(time_ns - pose.ahead_ns, now_ns),
        north_m=within(pose.north_m + dn, MOST_COORDINATE_M),
        east_m=within(pose.east_m + de, MOST_COORDINATE_M),
        down_m=within(down_m, MOST_COORDINATE_M),
        covariance_m2=told_covariance(nn, ne, ee),
        heading_rad=wrap_rad(last + pose.turn_rad),
        heading_sd_rad=math.sqrt(turn_rad2),
        last_proximity_time_ns=log.near_ns,
        down_sd_m=within(down_sd_m, MOST_COORDINATE_M),
        floors=tuple(
            FloorShare(level_m, share)
            for level_m, share in storey_shares(down_m, down_sd_m, storeys_m)[:MOST_FLOORS]
            if share >= LEAST_FLOOR_SHARE
        ),
        status=status,
        reason=reason,
    )


def _moved(pose: Pose, since: WaySince) -> tuple[float, float]:
    longer = 1.0 + pose.scale
    return rotated(
        pose.turn_rad, longer * math.fsum(since.north_m), longer * math.fsum(since.east_m)
    )


def _covariance(
    pose: Pose, since: WaySince, way_m: tuple[float, float], unheard_m2: float,
    settings: TeamSettings,
) -> tuple[float, float, float, float]:  # fmt: skip
    """Return nn, ne, ee and the turn's variance at the end of the way since the pose.

    A way that may be turned by much ends on an arc, which bends back from the straight line along
    which the ellipse of small turns lies. How far, its turn tells: from where the way is turned
    the end is as far as place and turn go together.
    """
    dn, de = way_m
    nn, ne, ee, tt, nt, et = pose.covariance
    tt = min(max(tt, 0.0), UNIFORM_TURN_RAD2)
    from_n, from_e = (dn + et / tt, de - nt / tt) if tt > 0.0 else way_m
    back = bent_back(tt)
    own_m2 = unheard_m2 + math.fsum(since.place_m2) + math.fsum(since.own_m2)
    factor = settings.covariance_factor
    turn_rad2 = tt + since.count * settings.stride_turn_sd_rad**2
    turn_rad2 += math.fsum(since.turn_rad2)
    return (
        factor * (nn - 2.0 * de * nt + de * de * tt + own_m2 + back * from_n * from_n),
        factor * (ne + dn * nt - de * et - dn * de * tt + back * from_n * from_e),
        factor * (ee + 2.0 * dn * et + dn * dn * tt + own_m2 + back * from_e * from_e),
        min(turn_rad2, UNIFORM_TURN_RAD2),
    )


def bent_back(turn_rad2: float) -> float:
    """Return the mean square of 1 - cos θ, θ being normal about nought with that variance (rad²).

    It is 3 v² / 4 of a small variance v; of any up to some 2 rad² this is near
    (1 + exp(-2 v)) / 2 - 2 exp(-v / 2) + 1.
    """
    return 0.75 * turn_rad2 * turn_rad2 / (1.0 + turn_rad2)


def _status(
    pose: Pose,
    time_ns: int,
    covariance_m2: tuple[float, float, float],
    turn_rad2: float,
    settings: TeamSettings,
) -> tuple[TrackStatus, str]:
    """Return how a track is doing, and why in words where it is not ``tracking``."""
    nn, _, ee = covariance_m2
    sd_m = math.sqrt(max(nn, ee, 0.0))
    untied_s = (time_ns - pose.tied_ns) / NS_PER_S
    is_sharp = pose.is_told and math.sqrt(turn_rad2) <= settings.recovered_turn_sd_rad
    if pose.unit > 0 and not is_sharp:
        since_s = (time_ns - pose.unit_ns) / NS_PER_S
        return "recovering", f"the unit began anew {since_s:.0f} s ago; which way is not yet known"
    if sd_m > settings.lost_sd_m:
        why = "heading not known" if turn_rad2 > 1.0 else f"nothing passed for {untied_s:.0f} s"
        return "lost", f"{why}: may be {2.0 * sd_m:.0f} m off"
    if untied_s > settings.untied_s:
        return "dead_reckoning", f"no DAP or crew passed for {untied_s:.0f} s"
    return "tracking", ""
