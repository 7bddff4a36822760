"""When to set down the next DAP, as the one who carries it walks on (pure).

What a DAP tells is a sum over those who pass it: each pass gains ½ log₂ det(I + P R⁻¹) bits of a
place known to P, R being the tie's covariance. P grows with the metres walked since a DAP was
passed. How many will pass is guessed from the way back to the entrance: all come along it while it
is straight, and fewer after each turn off it; in rooms hardly anybody. And fewer the later it is,
for most have passed by then. A DAP that is set down without being passed again tells nothing: so
they belong on the way that all share, and boxes that would not are kept. Apart from that one is
wanted while the last one is still heard, for by it what is said comes out. What the unit knows of
that are its own movements and how loud DAPs are: no map, and nobody else's track. The agent tells
its wearer, the simulator lets those whom it simulates do as they are told.
"""

from __future__ import annotations

import math
from collections import deque
from typing import Annotated, NamedTuple, TypeAlias

import msgspec
from msgspec import Meta

from shared.messages import Activity, NodeId, Vector3
from shared.units import NS_PER_S
from shared.way_back import WayBack

Dbm: TypeAlias = Annotated[float, Meta(ge=-200.0, le=100.0)]
Metres: TypeAlias = Annotated[float, Meta(gt=0.0, le=1e4)]
Share: TypeAlias = Annotated[float, Meta(ge=0.0, le=1.0)]

STAIRS: frozenset[Activity] = frozenset({"stairs_up", "stairs_down", "ladder", "lift"})
"""Movements from storey to storey."""

LEAST_MOVE_M = 0.2
"""A shorter one is a turn on the spot."""

STEEPEST_DB_M = 1.5
"""What falls more steeply is one wall, or a fade, and does not go on so."""

STRAIGHT = 0.95
"""So far over so long is to have come straight."""

OFF_THE_WAY = 0.4
"""Where fewer than this share pass, it is a room or a side way."""

WALL_DB = 5.0
"""Between a light inner wall and a brick one (COST 231, multi-wall model)."""


class AdviserSettings(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What counts as near, as covered, as a weak link, and how much a place is worth.

    Levels (dBm) are of the loudest DAP over ``window_s``: from ``by_dbm`` on it is passed, from
    ``covered_dbm`` on no further one is wanted. A link of ``weak_dbm`` begins to be in need; one of
    ``breaking_dbm``, ``ahead_m`` further on as the level falls now, is all but gone. With no DAP
    passed for ``every_m``, and ``later_share`` of all that the wearer has walked, the need for a
    tie is full. It counts by how straight the way back is, all of it and the last ``around_m``,
    each to the power ``parting``; not before it is ``least_in_m`` long, and fully within
    ``lasts_m`` of stairs. Who comes within ``meets_m`` of their way of ``least_loop_m`` ago is
    there again. To turn by ``turn_rad`` after going straight for ``straight_m`` is a junction, for
    ``lasts_m``, where a need counts ``at_junction`` times. Advice is raised from ``raise_at`` on,
    dropped under ``drop_at``. It is not raised again within ``again_m``, nor, before it was
    dropped, within ``repeat_m``.
    """

    window_s: Annotated[float, Meta(gt=0.0, le=60.0)] = 2.0
    by_dbm: Dbm = -53.0
    covered_dbm: Dbm = -59.0
    weak_dbm: Dbm = -78.0
    breaking_dbm: Dbm = -88.0
    ahead_m: Metres = 5.0
    power_at_1_m_dbm: Dbm = -40.0
    path_loss_exponent: Annotated[float, Meta(ge=1.0, le=6.0)] = 2.2
    every_m: Metres = 13.0
    later_share: Share = 0.17
    parting: Annotated[float, Meta(ge=0.0, le=20.0)] = 3.0
    least_in_m: Metres = 4.0
    meets_m: Metres = 2.0
    least_loop_m: Metres = 6.0
    turn_rad: Annotated[float, Meta(gt=0.0, le=3.2)] = math.radians(45.0)
    straight_m: Metres = 6.0
    around_m: Metres = 20.0
    lasts_m: Metres = 3.0
    at_junction: Annotated[float, Meta(ge=1.0, le=10.0)] = 1.3
    raise_at: Share = 0.6
    drop_at: Share = 0.4
    again_m: Metres = 8.0
    repeat_m: Metres = 25.0

    def __post_init__(self) -> None:
        """Refuse thresholds the wrong way round."""
        if self.drop_at >= self.raise_at:
            raise ValueError("drop_at: put it below raise_at")
        if not self.breaking_dbm < self.weak_dbm < self.covered_dbm < self.by_dbm:
            raise ValueError(
                "levels: put breaking_dbm, weak_dbm, covered_dbm, by_dbm in that order"
            )


class Advice(NamedTuple):
    """'Set one down now', at ``time_ns``: how urgent from 0 to 1, and why, in words."""

    time_ns: int
    urgency: float
    reason: str


class _Need(NamedTuple):
    """How much a DAP is needed, from 0 to 1, and for what."""

    need: float
    words: str


class _Site(NamedTuple):
    """A junction or stairs: what, after how many metres walked, and what share of all passes."""

    kind: str
    walked_m: float
    worth: float


class DropAdviser:
    """Takes movements and signal strengths as they come; says when a DAP had better be set down.

    ``boxes`` are left to the wearer; with none left nothing is said. They are switched on as they
    are set down: one that is new and loud where advice stands counts as that one.
    """

    def __init__(self, boxes: int, settings: AdviserSettings | None = None) -> None:
        self.boxes = boxes
        self._settings = settings or AdviserSettings()
        self._way = WayBack(self._settings.meets_m, self._settings.least_loop_m)
        self._walked_m = 0.0
        self._heard: dict[NodeId, deque[tuple[int, float]]] = {}
        self._passed_m: dict[NodeId, float] = {}
        self._levels: deque[tuple[float, float]] = deque()
        # One goes in past the door, where the first DAP stands.
        self._by_m = 0.0
        self._site: _Site | None = None
        self._climbs: Activity | None = None
        self._raised = False
        self._raised_m = -math.inf

    def hear(self, time_ns: int, dap_id: NodeId, rssi_dbm: float) -> None:
        """Take in how loud a DAP is at the wearer's unit."""
        heard = self._heard.setdefault(dap_id, deque())
        heard.append((time_ns, rssi_dbm))
        while heard[0][0] < time_ns - self._settings.window_s * NS_PER_S:
            heard.popleft()

    def set_down(self) -> None:
        """Note that the wearer has set one down here."""
        self.boxes -= 1
        self._by_m = self._walked_m
        self._raised = False

    def move(self, time_ns: int, displacement_m: Vector3, activity: Activity) -> Advice | None:
        """Take in a movement in the unit's own frame; return advice if it is to be given now."""
        self._note_site(displacement_m, activity)
        self._walk(displacement_m)
        level_dbm = self._look(time_ns)
        if self.boxes < 1:
            return None
        need, words = max(self._for_tie(level_dbm), self._for_link(level_dbm))
        if level_dbm is not None and level_dbm >= self._settings.covered_dbm:
            need = 0.0
        return self._told(Advice(time_ns, need, words))

    def heed(self, time_ns: int, reason: str) -> Advice | None:
        """Take in that somebody who sees more wants one here; return it if it is to be said now."""
        level_dbm = self._look(time_ns)
        is_covered = level_dbm is not None and level_dbm >= self._settings.covered_dbm
        if self.boxes < 1 or is_covered:
            return None
        return self._told(Advice(time_ns, self._settings.raise_at, reason))

    def _told(self, advice: Advice) -> Advice | None:
        """Return the advice if it is new: that which stands is not said again."""
        settings = self._settings
        if advice.urgency < settings.drop_at:
            self._raised = False
        walked_m = self._walked_m
        waits_m = settings.repeat_m if self._raised else settings.again_m
        if advice.urgency < settings.raise_at or walked_m - self._raised_m < waits_m:
            return None
        self._raised, self._raised_m = True, walked_m
        return advice

    def _note_site(self, displacement_m: Vector3, activity: Activity) -> None:
        """Note where ways meet, or stairs begin or end: that is where the movement begins."""
        climbs = activity if activity in STAIRS else None
        if climbs != self._climbs:
            kind = "at the lift" if "lift" in (climbs, self._climbs) else "at the stairs"
            self._site = _Site(kind, self._walked_m, 1.0)
            self._climbs = climbs
            self._way.come_in()
        north_m, east_m, _ = displacement_m
        length_m = math.hypot(north_m, east_m)
        straight = self._way.direction(self._settings.straight_m, STRAIGHT)
        if climbs or activity == "side_step" or length_m < LEAST_MOVE_M or straight is None:
            return
        along = (north_m * straight[0] + east_m * straight[1]) / length_m
        if along < math.cos(self._settings.turn_rad):
            worth = self._share() * self._settings.at_junction
            self._site = _Site("at a junction", self._walked_m, worth)

    def _walk(self, displacement_m: Vector3) -> None:
        north_m, east_m, _ = displacement_m
        self._walked_m += math.hypot(north_m, east_m)
        if self._climbs is None:
            self._way.walk(north_m, east_m)

    def _look(self, time_ns: int) -> float | None:
        """Return how loud the loudest DAP is (dBm), noting which are passed; ``None`` if none."""
        since_ns = time_ns - round(self._settings.window_s * NS_PER_S)
        walked_m = self._walked_m
        loudest_dbm: float | None = None
        for dap_id, heard in self._heard.items():
            recent = [dbm for at_ns, dbm in heard if at_ns > since_ns]
            if not recent:
                continue
            level_dbm = math.fsum(recent) / len(recent)
            if level_dbm >= self._settings.by_dbm:
                if self._raised and dap_id not in self._passed_m:
                    # It was not there before, and one was asked for: this is it.
                    self.set_down()
                self._by_m = self._passed_m[dap_id] = walked_m
            if loudest_dbm is None or level_dbm > loudest_dbm:
                loudest_dbm = level_dbm
        if loudest_dbm is not None:
            self._levels.append((walked_m, loudest_dbm))
        while self._levels and self._levels[0][0] < walked_m - self._settings.ahead_m:
            self._levels.popleft()
        return loudest_dbm

    def _for_tie(self, level_dbm: float | None) -> _Need:
        """Say how much a DAP is needed to tie tracks: by metres since one, and who will pass."""
        settings = self._settings
        since_m = self._walked_m - self._by_m
        where, worth = self._where()
        near = "" if level_dbm is None else f", the next one at {level_dbm:.0f} dBm"
        every_m = settings.every_m + settings.later_share * self._walked_m
        need = min(since_m / every_m * worth, 1.0)
        return _Need(need, f"{where}, {since_m:.0f} m since the last DAP{near}")

    def _for_link(self, level_dbm: float | None) -> _Need:
        """Say how much a DAP is needed for what is said to come out of the building."""
        settings = self._settings
        if not self._heard:
            return _Need(0.0, "")
        where, worth = self._where()
        worth = 0.4 + 0.6 * worth
        if level_dbm is None:
            return _Need(worth, f"{where}, no DAP is heard any more")
        falls_db_m = min(max(-self._slope_db_m(), 0.0), STEEPEST_DB_M)
        coming_dbm = level_dbm - settings.ahead_m * falls_db_m
        span_db = settings.weak_dbm - settings.breaking_dbm
        need = min(max((settings.weak_dbm - coming_dbm) / span_db, 0.0), 1.0)
        walls = self._walls(level_dbm)
        behind = f", behind {walls} walls or more" if walls > 1 else ""
        words = f"{where}, link at {level_dbm:.0f} dBm, falling {falls_db_m:.1f} dB/m{behind}"
        return _Need(need * worth, words)

    def _where(self) -> tuple[str, float]:
        """Say what kind of place this is, and what a need counts here."""
        if self._climbs is not None:
            return "on stairs", 0.0
        site = self._site
        if site is not None and self._walked_m - site.walked_m <= self._settings.lasts_m:
            return site.kind, site.worth
        if self._way.length_m < self._settings.least_in_m:
            return "at the entrance", 0.0
        worth = self._share()
        return "off the way" if worth < OFF_THE_WAY else "on the way", worth

    def _share(self) -> float:
        """Guess what share of all will pass here, from how straight the way back is."""
        last = self._way.straightness(self._settings.around_m)
        return math.pow(last * self._way.straightness(math.inf), self._settings.parting)

    def _slope_db_m(self) -> float:
        """Return by how much the level rises for each metre walked, over the last ones."""
        count = len(self._levels)
        if count < 3 or self._levels[-1][0] - self._levels[0][0] < 0.5 * self._settings.ahead_m:
            return 0.0
        mean_m = math.fsum(at_m for at_m, _ in self._levels) / count
        mean_dbm = math.fsum(dbm for _, dbm in self._levels) / count
        spread = math.fsum((at_m - mean_m) ** 2 for at_m, _ in self._levels)
        return math.fsum((at_m - mean_m) * (dbm - mean_dbm) for at_m, dbm in self._levels) / spread

    def _walls(self, level_dbm: float) -> int:
        """Guess how many walls at least are between, from how far it can be to the last DAP.

        It is no further than what was walked since it was passed.
        """
        if not self._passed_m:
            return 0
        far_m = max(self._walked_m - max(self._passed_m.values()), 1.0)
        free_dbm = self._settings.power_at_1_m_dbm
        free_dbm -= 10.0 * self._settings.path_loss_exponent * math.log10(far_m)
        return max(round((free_dbm - level_dbm) / WALL_DB), 0)
