"""Four responders on patrol past five DAPs, apart from the simulator, with one thing wrong or none.

They walk the corridors of a house for some six minutes; a DAP tells each pass within 4 m as a peak.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from msgspec import structs
from numpy.typing import NDArray

from shared.messages import Message, RssiPeak
from tests.stride_world import at_ns, installation, stride, track_start

STRIDE_M = 1.2
STRIDE_S = 1.1
REACH_M = 4.0
SET_DOWN_AHEAD_M = 0.25
"""So far before themselves somebody sets a DAP down."""
NEVER_S = math.inf
CARRIED_S = 50.0

Floats = NDArray[np.float64]

CORNERS_M: dict[str, list[tuple[float, float]]] = {
    "r1": [(0, 0), (0, 30), (20, 30), (20, 0)],
    "r2": [(0, 0), (20, 0), (20, 30), (0, 30)],
    "r3": [(0, 0), (0, 15), (20, 15), (20, 30), (0, 30), (0, 15), (20, 15), (20, 0)],
    "r4": [(0, 0), (0, 30), (20, 30), (20, 15), (0, 15)],
}
ROUNDS = {"r1": 4, "r2": 4, "r3": 3, "r4": 4}
DAPS_M = {
    "dap1": (0.0, 5.0), "dap2": (0.0, 22.0), "dap3": (11.0, 30.5), "dap4": (19.5, 20.0),
    "dap5": (20.5, 6.0), "dap6": (10.0, 15.5),
}  # fmt: skip
SET_DOWN_BY = {"dap2": "r1", "dap3": "r1", "dap4": "r1", "dap5": "r2", "dap6": "r3"}
OFFSETS_DEG = {"r1": 1.0, "r2": -12.0, "r3": 15.0, "r4": 8.0}
DRIFTS_DEG_S = {"r1": 0.02, "r2": -0.04, "r3": 0.03, "r4": -0.02}


@dataclass(frozen=True)
class Faults:
    """What is wrong from ``since_s`` on; of clock, scale and start, from the beginning.

    ``carried`` is a DAP that somebody has in their hands for ``CARRIED_S``, and sets down again
    where it stood; ``begins_off_m`` how far north of where they are somebody's unit says to begin.
    """

    since_s: float = 150.0
    moved: tuple[str, tuple[float, float]] | None = None
    astray: str | None = None
    swapped: tuple[str, str] | None = None
    renewed: tuple[str, float] | None = None
    ahead_s: tuple[str, float] | None = None
    scale: tuple[str, float] | None = None
    carried: tuple[str, str] | None = None
    begins_off_m: tuple[str, float] | None = None


@dataclass(frozen=True)
class Patrol:
    """What is heard, in the order of its time, and where each responder was: times, places."""

    heard: list[tuple[str, Message]]
    ways: dict[str, tuple[Floats, Floats]]

    def place_m(self, responder_id: str, time_s: float) -> Floats:
        """Return where somebody truly was."""
        times, places = self.ways[responder_id]
        return np.array([np.interp(time_s, times, axis) for axis in places.T])


def patrol(seed: int, faults: Faults | None = None) -> Patrol:
    """Return one exercise."""
    faults = faults or Faults(NEVER_S)
    chance = np.random.default_rng([seed, 815])
    ways = {name: _way(name, number) for number, name in enumerate(CORNERS_M)}
    heard: list[tuple[str, Message]] = []
    for name, way in ways.items():
        heard += [(name, each) for each in _strides(name, way, faults, chance)]
    for dap_id, place_m in DAPS_M.items():
        heard += [(dap_id, each) for each in _told(dap_id, np.array(place_m), ways, faults, chance)]
    return Patrol(sorted(heard, key=lambda each: (each[1].event_time_ns, each[0])), ways)


def _way(name: str, number: int) -> tuple[Floats, Floats]:
    places = [np.zeros(2)]
    for corner in (CORNERS_M[name] * ROUNDS[name])[1:]:
        leg_m = np.array(corner) - places[-1]
        count = max(round(float(np.hypot(*leg_m)) / STRIDE_M), 1)
        begin = places[-1]
        places += [begin + leg_m * (k + 1) / count for k in range(count)]
    time_s = 5.0 + 15.0 * number + STRIDE_S * np.arange(len(places), dtype=np.float64)
    return time_s, np.array(places)


def _unit(way_m: Floats) -> Floats:
    return way_m / float(np.hypot(*way_m))


def _ahead_s(faults: Faults, node_id: str) -> float:
    return faults.ahead_s[1] if faults.ahead_s and faults.ahead_s[0] == node_id else 0.0


def _strides(
    name: str, way: tuple[Floats, Floats], faults: Faults, chance: np.random.Generator
) -> list[Message]:
    times, places = way
    ahead_s = _ahead_s(faults, name)
    scale = faults.scale[1] if faults.scale and faults.scale[0] == name else 1.0
    first_rad = math.radians(OFFSETS_DEG[name])
    sd_rad = math.radians(2.0 if name == "r1" else 30.0)
    start = track_start(times[0] - 1.0 + ahead_s, sd_rad)
    if faults.begins_off_m and faults.begins_off_m[0] == name and start.position:
        said = structs.replace(start.position, north_m=faults.begins_off_m[1])
        start = structs.replace(start, position=said)
    told: list[Message] = [start]
    jitter = np.cumsum(math.radians(0.4) * chance.standard_normal(len(times)))
    for k, step_m in enumerate(np.diff(places, axis=0)):
        off = first_rad + math.radians(DRIFTS_DEG_S[name]) * (times[k] - times[0]) + jitter[k]
        if faults.renewed and faults.renewed[0] == name and times[k] >= faults.since_s:
            off += faults.renewed[1]
        north = math.cos(off) * step_m[0] + math.sin(off) * step_m[1]
        east = -math.sin(off) * step_m[0] + math.cos(off) * step_m[1]
        noise = 0.03 * chance.standard_normal(2)
        told.append(
            stride(
                float(times[k + 1]) + ahead_s, scale * north + noise[0], scale * east + noise[1],
                sequence=k,
            )
        )  # fmt: skip
    return told


def _told(
    dap_id: str,
    place_m: Floats,
    ways: dict[str, tuple[Floats, Floats]],
    faults: Faults,
    chance: np.random.Generator,
) -> list[Message]:
    by = SET_DOWN_BY.get(dap_id)
    ahead_s = _ahead_s(faults, dap_id)
    down_s = 0.0
    if by is not None:
        times, places = ways[by]
        nearest = int(np.argmin(np.hypot(*(places[:60] - place_m).T)))
        down_s = float(times[nearest]) + 0.1
        place_m = places[nearest] + SET_DOWN_AHEAD_M * _unit(places[nearest] - places[nearest - 1])
    known = None if by else (float(place_m[0]), float(place_m[1]))
    told: list[Message] = [installation(down_s + ahead_s, by, known)]
    astray = faults.astray == dap_id
    for name, (times, places) in ways.items():
        moved = faults.moved if faults.moved and faults.moved[0] == dap_id else None
        for time_s, range_m in _passes(times, places, place_m, moved, faults.since_s):
            if time_s < down_s + 3.0 or (astray and time_s >= faults.since_s):
                continue
            heard_as = _heard_as(name, time_s, faults)
            at_s = time_s + 0.15 * chance.standard_normal() + ahead_s
            told.append(_peak(at_s, heard_as, -38.0 - 3.0 * range_m + chance.standard_normal()))
        if faults.carried == (dap_id, name):
            in_hands_s = np.arange(faults.since_s, faults.since_s + CARRIED_S, 6.0)
            told += [_peak(float(time_s), name, -36.0) for time_s in in_hands_s]
        if astray:
            for time_s in np.arange(faults.since_s, times[-1], 25.0):
                at_s = float(time_s) + chance.uniform(0.0, 20.0)
                told.append(_peak(at_s, name, -42.0 + chance.standard_normal()))
    return told


def _passes(
    times: Floats,
    places: Floats,
    place_m: Floats,
    moved: tuple[str, tuple[float, float]] | None,
    since_s: float,
) -> list[tuple[float, float]]:
    """Return when somebody came nearest (s), and how near (m)."""
    fine_s = np.arange(times[0], times[-1], 0.1)
    fine_m = np.stack([np.interp(fine_s, times, axis) for axis in places.T], axis=1)
    stands = np.tile(place_m, (len(fine_s), 1))
    if moved is not None:
        stands[fine_s >= since_s] = moved[1]
    range_m = np.hypot(*(fine_m - stands).T)
    least = (range_m[1:-1] <= range_m[:-2]) & (range_m[1:-1] < range_m[2:])
    found = np.flatnonzero(least & (range_m[1:-1] < REACH_M)) + 1
    return [(float(fine_s[at]), float(range_m[at])) for at in found]


def _heard_as(name: str, time_s: float, faults: Faults) -> str:
    if faults.swapped and name in faults.swapped and time_s >= faults.since_s:
        return faults.swapped[1 - faults.swapped.index(name)]
    return name


def _peak(time_s: float, responder_id: str, peak_dbm: float) -> RssiPeak:
    return RssiPeak(
        event_time_ns=at_ns(time_s), sequence=0, responder_id=responder_id, peak_dbm=peak_dbm,
        width_s=1.0, sample_count=9,
    )  # fmt: skip
