"""Tells those who pass where a further DAP would tell most that this is the place (pure).

Who of them carries one, their units know: whoever does tells its wearer.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple, Protocol

from command_post.coverage import CELL_DOWN_M, Covariance, Coverage
from command_post.desks.announcer import Outgoing
from command_post.fusion.dap_map import InstalledDap
from command_post.fusion.track import Estimate
from shared.messages import NodeId, SiteAdvice
from shared.units import NS_PER_S

HERE_M = 4.0
"""Whoever is held to be so near a site is at it."""

FRESH_NS = 5 * NS_PER_S
"""Who was not heard of for so long may be elsewhere."""

AGAIN_NS = 60 * NS_PER_S
"""Nobody is told again within this."""


class _Somebody(NamedTuple):
    """Where a responder is, as coverage takes it."""

    responder_id: NodeId
    north_m: float
    east_m: float
    down_m: float
    covariance_m2: Covariance


class Known(Protocol):
    """As much of an incident as is looked at."""

    @property
    def estimates(self) -> Mapping[NodeId, Estimate]:
        """Where responders are held to be."""

    @property
    def daps(self) -> Mapping[str, InstalledDap]:
        """Where DAPs stand."""

    def said(self, message: SiteAdvice, /) -> Outgoing:
        """Return it as it is to be published."""


class SiteDesk:
    """Follows where crews pass and how well they are known; says who is where a DAP is wanted."""

    def __init__(self) -> None:
        self._coverage = Coverage()
        self._told_ns: dict[NodeId, int] = {}
        self._said = 0

    def due(self, incident: Known, now_ns: int) -> list[Outgoing]:
        """Return what is to be published at ``now_ns``, given where responders and DAPs are."""
        here = {
            name: _Somebody(name, each.north_m, each.east_m, each.down_m, each.covariance_m2)
            for name, each in incident.estimates.items()
            if each.status == "tracking" and now_ns - each.time_ns < FRESH_NS
        }
        for somebody in here.values():
            self._coverage.take(somebody, now_ns)
        said = []
        for site in self._coverage.sites(dap.position for dap in incident.daps.values()):
            for name, place in here.items():
                away_m = math.hypot(place.north_m - site.north_m, place.east_m - site.east_m)
                apart_m = abs(place.down_m - site.down_m)
                is_new = now_ns - self._told_ns.get(name, -AGAIN_NS) >= AGAIN_NS
                if is_new and away_m <= HERE_M and apart_m <= CELL_DOWN_M:
                    said.append(incident.said(self._advice(name, site.reason, now_ns)))
        return said

    def _advice(self, responder_id: NodeId, reason: str, now_ns: int) -> SiteAdvice:
        self._told_ns[responder_id] = now_ns
        self._said += 1
        return SiteAdvice(
            event_time_ns=now_ns,
            sequence=self._said - 1,
            responder_id=responder_id,
            reason=reason,
        )
