"""A cloud of particles in front of the smoother, for whom one Gaussian cannot tell (pure).

While nobody knows which way a unit's frame is turned, its wearer may be anywhere on a ring about
where they set out, and every DAP that they pass leaves but a few ways. The smoother, linear about
one solution, cannot say that; particles can. Once the heading is known they are let go.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from command_post.fusion.cloud.chance import responder_stream, step_key
from command_post.fusion.cloud.cloud import Cloud, Step, advance, moments, spawn
from command_post.fusion.cloud.model import ANY_HEADING_SD_RAD, Mixture, Tie
from command_post.fusion.cloud.regions import regions
from command_post.fusion.team.chain import Chain
from command_post.fusion.team.estimates import SILENT
from command_post.fusion.team.graph import LEAD
from command_post.fusion.team.log import ResponderLog
from command_post.fusion.team.settings import TeamSettings
from command_post.fusion.team.solving import Solved
from command_post.fusion.track import MOST_COORDINATE_M, Estimate, told_covariance, within
from shared.maths.angles import wrap_rad
from shared.messages import OdometryIncrement

SEED = 1
KNOWN_PLACE_SD_M = 5.0
WIDEST_REGION_M = 10_000.0
"""Nobody needs the outline of a wider one."""


def cloud_before(
    solved: Solved, index: int, log: ResponderLog, until_ns: int, settings: TeamSettings
) -> Cloud | None:
    """Return the cloud of the chain at ``index`` at ``until_ns``; ``None`` if it needs none.

    It is made anew from the start of the unit, so that it depends on what was heard alone. It
    knows nothing of ways that nobody told of.
    """
    chain = solved.assembled.chains[index]
    unit = int(chain.unit[-1])
    stance = chain.begin_of(unit)
    is_unheard = chain.unheard.size > 0 and int(chain.unheard[-1]) > stance
    if is_unheard or solved.tells_turn(index, settings):
        return None
    begin_ns = chain.starts[unit].time_ns
    nodes = solved.assembled.nodes[index]
    node = int(solved.assembled.graph.first[index]) + int(np.searchsorted(nodes, stance))
    place_m2 = settings.start_sd_m**2 if unit == 0 else 2.0 * _gone_m2(chain, stance)
    mean = np.array([[*solved.pose[node, :2], 0.0, 0.0]])
    spread = np.diag([place_m2, place_m2, ANY_HEADING_SD_RAD**2, settings.scale_sd**2])
    stream = responder_stream(SEED, chain.responder_id)
    cloud = spawn(
        Mixture(np.ones(1), mean, spread[None]), settings.front_particles, step_key(stream, unit, 1)
    )
    ties = _ties(solved, index, begin_ns)
    moves = [m for m in log.moves.messages_until(until_ns) if m.event_time_ns > begin_ns]
    steps = [
        Step(step_key(stream, m.event_time_ns), m, ties=ties.get(m.event_time_ns, ()))
        for m in moves
    ]
    return advance(cloud, steps)[0] if steps else cloud


def _gone_m2(chain: Chain, stance: int) -> float:
    """Return the variance of the way to a stance (m²), since others told of them if they did."""
    since = int(chain.unheard[-1]) if chain.unheard.size else 0
    return float(chain.variance[stance, 0] - chain.variance[since, 0])


def _ties(solved: Solved, index: int, since_ns: int) -> dict[int, list[Tie]]:
    """Return the unit's passes of places that others have put on the map, by stance."""
    assembled = solved.assembled
    first, end = assembled.graph.first[index : index + 2].tolist()
    chain, nodes = assembled.chains[index], assembled.nodes[index]
    base = assembled.place_column(0)
    lead_s = float(solved.arrow[LEAD])
    found: dict[int, list[Tie]] = {}
    for row, (node, column, *_) in enumerate(assembled.graph.tie_at.tolist()):
        place = (column - base) // 2
        if not first <= node < end or assembled.installed_by[place] == index:
            continue
        time_ns = int(chain.time_ns[nodes[node - first]])
        (nn, ne), (_, ee) = solved.shared[column : column + 2, column : column + 2].tolist()
        if time_ns > since_ns and max(nn, ee) < KNOWN_PLACE_SD_M**2:
            north_m, east_m, sd_m, dof, fast_north, fast_east = assembled.graph.tie[row].tolist()
            north_m += lead_s * fast_north
            east_m += lead_s * fast_east
            at = solved.arrow[column : column + 2].tolist()
            tie = Tie(at[0], at[1], (nn, ne, ee), sd_m, dof, (-north_m, -east_m))
            found.setdefault(time_ns, []).append(tie)
    return found


def cloud_of_turns(
    solved: Solved, index: int, time_ns: int, settings: TeamSettings
) -> Cloud | None:
    """Return a cloud of where the chain at ``index`` ends, however its map may be turned.

    ``None`` if how that is turned is told.
    """
    ways = solved.ways_of(index)
    if not ways:
        return None
    chain = solved.assembled.chains[index]
    end = int(solved.assembled.graph.first[index + 1]) - 1
    unit = int(chain.unit[-1])
    means, spreads = [], []
    for _, way in ways:
        scale = float(way.arrow[way.assembled.unit_column(index, unit)])
        nn, ne, ee, tt, nt, et = way.ends[index].tolist()
        means.append([*way.pose[end].tolist(), scale])
        spreads.append([
            [nn, ne, nt, 0.0],
            [ne, ee, et, 0.0],
            [nt, et, tt, 0.0],
            [0.0, 0.0, 0.0, settings.scale_sd**2],
        ])  # fmt: skip
    shares = np.array([share for share, _ in ways])
    mixture = Mixture(shares, np.array(means), np.array(spreads))
    stream = responder_stream(SEED, chain.responder_id)
    return spawn(mixture, settings.front_particles, step_key(stream, time_ns, 1))


class Fronts:
    """The clouds of all who have one, and what was told last of each.

    Of hundreds of late strides none moves where somebody is by now, and each is answered: outlines
    take a hundred times as long as all else of that.
    """

    def __init__(self) -> None:
        self._fronts: dict[str, _Front] = {}
        self._told: dict[str, _Told] = {}

    def keep(
        self, solved: Solved, index: int, log: ResponderLog, time_ns: int, settings: TeamSettings
    ) -> None:
        """Keep what cloud the chain at ``index`` needs at ``time_ns``, if it needs one."""
        responder_id = solved.assembled.chains[index].responder_id
        cloud = cloud_before(solved, index, log, time_ns, settings)
        on_map = cloud is None
        if on_map:
            cloud = cloud_of_turns(solved, index, time_ns, settings)
        if cloud is None:
            self._fronts.pop(responder_id, None)
        else:
            self._fronts[responder_id] = _Front(cloud, on_map)

    def told(
        self, estimate: Estimate, log: ResponderLog, since_ns: int, responder_id: str,
        settings: TeamSettings,
    ) -> Estimate:  # fmt: skip
        """Return the estimate as the cloud has it, moved since then; as it is without a cloud."""
        front = self._fronts.get(responder_id)
        if front is None:
            return estimate
        since = log.moves.messages_after(since_ns)
        heading_rad = log.moves.last_heading_rad
        before = self._told.get(responder_id)
        asked = (estimate, tuple(since), heading_rad)
        if before is None or before.cloud is not front.cloud or before.asked != asked:
            tell = told_on_map if front.on_map else told_by_cloud
            found = tell(estimate, front.cloud, since, heading_rad, responder_id, settings)
            before = self._told[responder_id] = _Told(front.cloud, asked, found)
        return before.estimate


class _Front(NamedTuple):
    """A cloud, and whether it is ``on_map``: of the ways in which that may be turned."""

    cloud: Cloud
    on_map: bool


class _Told(NamedTuple):
    """An estimate that a cloud made of another, the moves since and a heading."""

    cloud: Cloud
    asked: tuple[Estimate, tuple[OdometryIncrement, ...], float]
    estimate: Estimate


def told_by_cloud(
    estimate: Estimate, cloud: Cloud, since: Sequence[OdometryIncrement], heading_rad: float,
    responder_id: str, settings: TeamSettings,
) -> Estimate:  # fmt: skip
    """Return the estimate as the cloud has it, ``since`` being the moves after it was made.

    Where one may have gone since who is not heard of, the estimate's covariance tells.
    """
    cloud = _moved(cloud, since, responder_id)
    told = moments(cloud)
    sd_m = math.sqrt(max(told.covariance_m2[0], told.covariance_m2[2], 0.0))
    if sd_m > settings.lost_sd_m and estimate.status in {"tracking", "dead_reckoning"}:
        reason = f"heading not known: may be {2.0 * sd_m:.0f} m off"
        estimate = estimate._replace(status="lost", reason=reason)
    if not all(map(math.isfinite, (told.north_m, told.east_m, *told.covariance_m2))):
        return estimate
    nn, ne, ee = told.covariance_m2
    if is_silent := estimate.reason.startswith(SILENT):
        own_nn, own_ne, own_ee = estimate.covariance_m2
        nn, ne, ee = nn + own_nn, ne + own_ne, ee + own_ee
    return estimate._replace(
        north_m=within(told.north_m, MOST_COORDINATE_M),
        east_m=within(told.east_m, MOST_COORDINATE_M),
        covariance_m2=told_covariance(nn, ne, ee),
        heading_rad=wrap_rad(heading_rad + told.offset_rad),
        heading_sd_rad=told.offset_sd_rad,
        regions_m=() if is_silent or sd_m >= WIDEST_REGION_M else regions(cloud, told),
    )


def told_on_map(
    estimate: Estimate, cloud: Cloud, since: Sequence[OdometryIncrement], heading_rad: float,
    responder_id: str, settings: TeamSettings,
) -> Estimate:  # fmt: skip
    """Return the estimate where it is on the team's map, with the region that the cloud has.

    In the middle of all ways that the map may be turned nobody is, and a map whose parts were told
    so would be none. The covariance is about where the estimate is; of who is not heard of it
    grows, and tells more than outlines do.
    """
    cloud = _moved(cloud, since, responder_id)
    told = moments(cloud)
    off_n, off_e = told.north_m - estimate.north_m, told.east_m - estimate.east_m
    off_rad = wrap_rad(heading_rad + told.offset_rad - estimate.heading_rad)
    nn, ne, ee = told.covariance_m2
    nn, ne, ee = nn + off_n * off_n, ne + off_n * off_e, ee + off_e * off_e
    sd_m = math.sqrt(max(nn, ee, 0.0))
    heading_sd_rad = math.sqrt(told.offset_sd_rad**2 + off_rad * off_rad)
    if estimate.reason.startswith(SILENT):
        own_nn, own_ne, own_ee = estimate.covariance_m2
        wider = told_covariance(nn + own_nn, ne + own_ne, ee + own_ee)
        return estimate._replace(covariance_m2=wider, heading_sd_rad=heading_sd_rad)
    if sd_m > settings.lost_sd_m and estimate.status != "recovering":
        reason = f"which way the map is turned is not known: may be {2.0 * sd_m:.0f} m off"
        estimate = estimate._replace(status="lost", reason=reason)
    return estimate._replace(
        covariance_m2=told_covariance(nn, ne, ee),
        heading_sd_rad=heading_sd_rad,
        regions_m=regions(cloud, told) if sd_m < WIDEST_REGION_M else (),
    )


def _moved(cloud: Cloud, since: Sequence[OdometryIncrement], responder_id: str) -> Cloud:
    """Return a cloud after the moves ``since`` it was made."""
    if not since:
        return cloud
    stream = responder_stream(SEED, responder_id)
    return advance(cloud, [Step(step_key(stream, m.event_time_ns), m) for m in since])[0]
