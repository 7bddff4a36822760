"""Who has left their team (pure): further from all others of it than can be doubted, for a while.

Who is where is held only so surely: somebody is apart if the regions that hold them and each other
with 95 % are. Those who are lost say nothing of where the team is.
"""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple, TypeAlias

import msgspec
from msgspec import Meta

from command_post.confidence import CHI_SQUARE_95
from command_post.fusion.track import Estimate
from shared.messages import NodeId
from shared.units import NS_PER_S

FRESH_NS = 10 * NS_PER_S
"""Who was told of longer before may be anywhere by now."""

SD_TO_95 = 1.96
BACK_SHARE = 0.8
"""Who is held to be nearer to one of the team than this share of the limit is with it again."""


Crews: TypeAlias = dict[NodeId, tuple[NodeId, ...]]
"""Who is of which team."""


class Teams(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Who is of which team; who is ``apart_m`` from all others for ``apart_s`` has left it."""

    teams: Crews = {}
    apart_m: Annotated[float, Meta(gt=0.0, le=1e4)] = 30.0
    apart_s: Annotated[float, Meta(ge=0.0, le=3600.0)] = 30.0


class Left(NamedTuple):
    """That a responder has left their team, in words; or, without, that they are with it again."""

    responder_id: NodeId
    words: str | None


class TeamWatch:
    """Takes estimates as they come; tells who leaves their team, once, and who is back."""

    def __init__(self, settings: Teams) -> None:
        self._settings = settings
        self._team_of = {one: name for name, team in settings.teams.items() for one in team}
        self._newest: dict[NodeId, Estimate] = {}
        self._apart_since_ns: dict[NodeId, int] = {}
        self._left: set[NodeId] = set()

    def take(self, responder_id: NodeId, estimate: Estimate) -> list[Left]:
        """Take in where somebody is held to be; return what that makes of their team."""
        team = self._team_of.get(responder_id)
        if team is None:
            return []
        self._newest[responder_id] = estimate
        now_ns = estimate.time_ns
        known = {
            one: self._newest[one]
            for one in sorted(self._settings.teams[team])
            if one in self._newest
            and self._newest[one].status != "lost"
            and now_ns - self._newest[one].time_ns <= FRESH_NS
        }
        # Of two that are apart, either has left the other: one alert is enough.
        judged = list(known)[:1] if len(known) == 2 else list(known)
        return [left for one in judged if (left := self._judge(one, team, known, now_ns))]

    def _judge(
        self, one: NodeId, team: NodeId, known: dict[NodeId, Estimate], now_ns: int
    ) -> Left | None:
        here = known[one]
        others = [(_gap_m(here, each), _off_m(here, each), name)
                  for name, each in known.items() if name != one]  # fmt: skip
        if not others:
            return None
        gap_m, (off_m, nearest) = min(each[0] for each in others), min(each[1:] for each in others)
        if gap_m <= self._settings.apart_m:
            self._apart_since_ns.pop(one, None)
            if one in self._left and off_m < BACK_SHARE * self._settings.apart_m:
                self._left.discard(one)
                return Left(one, None)
            return None
        since_ns = self._apart_since_ns.setdefault(one, now_ns)
        if one in self._left or now_ns - since_ns < self._settings.apart_s * NS_PER_S:
            return None
        self._left.add(one)
        return Left(one, f"{off_m:.0f} m from {nearest}, the nearest of team {team}")


def _off_m(one: Estimate, other: Estimate) -> float:
    return math.dist(
        (one.north_m, one.east_m, one.down_m), (other.north_m, other.east_m, other.down_m)
    )


def _gap_m(one: Estimate, other: Estimate) -> float:
    """Return how far apart two are at least, with the 95 % regions of both."""
    north_m, east_m = other.north_m - one.north_m, other.east_m - one.east_m
    level_m = math.hypot(north_m, east_m)
    if level_m > 0.0:
        ahead = (north_m / level_m, east_m / level_m)
        back = (-ahead[0], -ahead[1])
        level_m = max(level_m - _reach_m(one, ahead) - _reach_m(other, back), 0.0)
    unsure_m = SD_TO_95 * ((one.down_sd_m or 0.0) + (other.down_sd_m or 0.0))
    upright_m = max(abs(other.down_m - one.down_m) - unsure_m, 0.0)
    return math.hypot(level_m, upright_m)


def _reach_m(estimate: Estimate, ahead: tuple[float, float]) -> float:
    """Return how far the region that holds somebody reaches in a direction (north, east)."""
    if estimate.regions_m:
        return max(
            (north_m - estimate.north_m) * ahead[0] + (east_m - estimate.east_m) * ahead[1]
            for outline in estimate.regions_m
            for north_m, east_m in outline
        )
    nn, ne, ee = estimate.covariance_m2
    along_m2 = nn * ahead[0] ** 2 + 2.0 * ne * ahead[0] * ahead[1] + ee * ahead[1] ** 2
    return math.sqrt(CHI_SQUARE_95 * max(along_m2, 0.0))
