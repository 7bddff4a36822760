"""A DAP that notices by itself that it was set down, or taken up again (pure).

With an accelerometer: it was carried, lies still now, and whoever was beside it then has gone, or
it has lain for long. Without one: somebody's signal was as strong as that of who carries it for
long, and then fell off for good; that they only stood beside it cannot be told apart, so a DAP
that stands is not installed anew so.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf
from typing import NamedTuple

from dap_node.rest import RestWatch
from shared.messages import NodeId, Vector3
from shared.rssi_window import Readings, sum_up
from shared.units import NS_PER_S

LOOK_NS = NS_PER_S // 2
KEPT_NS = 30 * NS_PER_S
LEVEL_NS = 3 * NS_PER_S // 2
LEAST_READINGS = 3

STILL_NS = 4 * NS_PER_S
STILL_FOR_LONG_NS = 20 * NS_PER_S
BESIDE_DBM = -55.0
"""Who set it down is heard at least so loud while they do."""

GONE_DB = 6.0
"""Who has gone is quieter by so much."""

CARRYING_DBM = -48.0
CARRIED_NS = 20 * NS_PER_S
FALL_DB = 12.0
LEFT_NS = 4 * NS_PER_S
PAUSE_NS = 3 * NS_PER_S
"""Who carries it may be quiet for so long."""

GIVEN_UP_NS = 30 * NS_PER_S
"""Who is neither beside it nor gone for so long was not carrying it."""


class PutDown(NamedTuple):
    """It was set down by somebody, who stood beside it at ``time_ns``."""

    time_ns: int
    installer_id: NodeId


class AtRest(NamedTuple):
    """It has lain still since ``time_ns``, having been taken up, and nobody was heard beside it.

    It was knocked over, or thrown, or swept along.
    """

    time_ns: int


class TakenUp(NamedTuple):
    """It does not stand any more since ``time_ns``: it is carried, or lies elsewhere."""

    time_ns: int


@dataclass
class _Carrier:
    """Somebody as loud as who carries it: since when, until when, how loud on the whole."""

    since_ns: int
    last_ns: int
    sum_db: float
    looks: int

    @property
    def _carried_long(self) -> bool:
        return self.last_ns - self.since_ns >= CARRIED_NS

    def look(self, now_ns: int, level_dbm: float) -> None:
        """Take in that they are beside it."""
        self.last_ns, self.looks = now_ns, self.looks + 1
        self.sum_db += level_dbm

    def has_gone(self, now_ns: int, level_dbm: float) -> bool:
        """Say whether they carried it for long, and are heard from afar now."""
        least_ns = self.last_ns + LEFT_NS
        fallen = -inf < level_dbm <= self.sum_db / self.looks - FALL_DB
        return self._carried_long and now_ns >= least_ns and fallen

    def is_given_up(self, now_ns: int) -> bool:
        """Say whether they have not been beside it for too long."""
        return now_ns - self.last_ns > (GIVEN_UP_NS if self._carried_long else PAUSE_NS)


class SelfInstallation:
    """Hears who is beside the box, feels how it lies, and says when it was set down or taken up.

    ``notices``: whether it says so; without, it only knows who is heard loudest.
    """

    def __init__(self, *, notices: bool = True) -> None:
        self._notices = notices
        self._rest = RestWatch()
        self._feels = False
        self._was_carried = False
        self._has_stood = False
        self._heard: dict[NodeId, Readings] = {}
        self._carriers: dict[NodeId, _Carrier] = {}
        self._looked_ns = 0

    def feel(self, time_ns: int, force_m_s2: Vector3) -> None:
        """Take in a sample of the box's own accelerometer."""
        self._feels = True
        self._rest.feel(time_ns, force_m_s2)

    def hear(self, time_ns: int, responder_id: NodeId, rssi_dbm: float) -> None:
        """Take in a reading of a responder's signal, calibrated."""
        self._heard.setdefault(responder_id, Readings()).add(time_ns, rssi_dbm)

    def loudest(self, now_ns: int, least_dbm: float = BESIDE_DBM) -> NodeId | None:
        """Return who is heard loudest around ``now_ns``; ``None`` if nobody is beside the box."""
        levels = {
            responder_id: self._level_dbm(responder_id, now_ns - 2 * LEVEL_NS, now_ns + LEVEL_NS)
            for responder_id in self._heard
        }
        best = max(
            levels, key=lambda responder_id: (levels[responder_id], responder_id), default=""
        )
        return best if levels.get(best, -inf) >= least_dbm else None

    def stands(self) -> None:
        """Note that the box was installed, by whatever means: it lies as it is to lie."""
        self._carriers.clear()
        self._was_carried = False
        self._has_stood = True
        self._rest.remember()

    def tick(self, now_ns: int, *, stands: bool) -> PutDown | AtRest | TakenUp | None:
        """Return what there is to tell, twice a second. ``stands``: whether it is installed."""
        if now_ns - self._looked_ns < LOOK_NS:
            return None
        self._looked_ns = now_ns
        for readings in self._heard.values():
            readings.forget_until(now_ns - KEPT_NS)
        self._heard = {name: readings for name, readings in self._heard.items() if readings}
        self._rest.tick(now_ns)
        if not self._notices:
            return None
        if not self._feels:
            return None if stands else self._left_by_carrier(now_ns)
        moved = self._rest.is_moved(now_ns)
        if stands:
            since_ns = self._rest.shaken_since_ns
            return TakenUp(since_ns or now_ns) if moved else None
        self._was_carried = self._was_carried or moved
        return self._come_to_rest(now_ns) if self._was_carried else None

    def _come_to_rest(self, now_ns: int) -> PutDown | AtRest | None:
        since_ns = self._rest.still_since_ns
        if since_ns is None or now_ns - since_ns < STILL_NS:
            return None
        lies_for_long = now_ns - since_ns >= STILL_FOR_LONG_NS
        installer_id = self.loudest(since_ns)
        if installer_id is None:
            return AtRest(since_ns) if lies_for_long and self._has_stood else None
        then_dbm = self._level_dbm(installer_id, since_ns - LEVEL_NS, since_ns + LEVEL_NS)
        now_dbm = self._level_dbm(installer_id, now_ns - LEVEL_NS, now_ns)
        has_gone = -inf < now_dbm <= then_dbm - GONE_DB
        if has_gone or lies_for_long:
            return PutDown(since_ns, installer_id)
        return None

    def _left_by_carrier(self, now_ns: int) -> PutDown | None:
        """Say who carried it for long and has gone, if nobody is beside it."""
        levels_dbm = {
            responder_id: self._level_dbm(responder_id, now_ns - LEVEL_NS, now_ns)
            for responder_id in sorted(self._heard.keys() | self._carriers.keys())
        }
        found: PutDown | None = None
        for responder_id, level_dbm in levels_dbm.items():
            if level_dbm >= CARRYING_DBM:
                new = _Carrier(now_ns, now_ns, 0.0, 0)
                self._carriers.setdefault(responder_id, new).look(now_ns, level_dbm)
                continue
            carrier = self._carriers.get(responder_id)
            if carrier is None:
                continue
            if carrier.has_gone(now_ns, level_dbm):
                # The level lags by half its window behind who walks away.
                found = PutDown(carrier.last_ns - LEVEL_NS // 2, responder_id)
            elif carrier.is_given_up(now_ns):
                del self._carriers[responder_id]
        is_beside = max(levels_dbm.values(), default=-inf) >= CARRYING_DBM
        return None if is_beside else found

    def _level_dbm(self, responder_id: NodeId, after_ns: int, until_ns: int) -> float:
        """Return the mean of somebody's readings; -inf of too few."""
        heard = self._heard.get(responder_id)
        window = {} if heard is None else heard.between(after_ns, until_ns)
        return sum_up(window).mean_dbm if len(window) >= LEAST_READINGS else -inf
