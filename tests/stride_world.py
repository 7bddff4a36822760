"""A small world of strides, apart from the simulator: three responders, four DAPs, known errors.

Responders walk corridors at constant stride. Each agent's heading is off by an offset, drifts at
a constant rate and jitters from stride to stride. A DAP tells who is within 2.5 m, once a second.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Literal, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from shared.codec import encode
from shared.messages import (
    DapInstallation,
    LocalPosition,
    Message,
    OdometryIncrement,
    ProximityEvent,
    TrackStart,
    Truth,
)
from shared.topics import TOPICS, Key, Role

INCIDENT = "exercise"
START_NS = 1_700_000_000_000_000_000
STRIDE_M = 1.2
STRIDE_S = 1.1
NEAR_M = 2.5
UPLINK_S = 0.2

Phase: TypeAlias = Literal["entered", "near", "left"]
Sent: TypeAlias = tuple[float, Role, str, Message]
"""When, by whom (role and id), and what."""

_TOPIC = {topic.message: name for name, topic in TOPICS.items()}


class Path(NamedTuple):
    """Times (n,) and places (n, 2) of the stances, and the corner reached there (n,), or 0."""

    time_s: NDArray[np.float64]
    place_m: NDArray[np.float64]
    corner: NDArray[np.int_]


class Heard(NamedTuple):
    """Bytes, the key they came under, and when."""

    now_ns: int
    key: str
    payload: bytes


@dataclass
class Walker:
    """A responder's way, when they set out, and the errors of their agent."""

    corners_m: list[tuple[float, float]]
    start_s: float
    offset_rad: float
    drift_rad_s: float
    scale: float = 1.0
    installs: dict[int, str] = field(default_factory=dict)


WALKERS = {
    "r1": Walker(
        [(0, 0), (0, 20), (15, 20), (15, 40), (0, 40), (0, 2), (0, 20), (15, 20), (15, 40),
         (0, 40), (0, 20)],
        0.0, math.radians(2.0), math.radians(0.02), 1.01, {1: "dap2"},
    ),
    "r2": Walker(
        [(0, 0), (0, 40), (-15, 40), (-15, 20), (0, 20), (0, 40), (-15, 40), (-15, 30)],
        40.0, math.radians(-25.0), math.radians(-0.05), 0.99, {1: "dap3", 2: "dap4"},
    ),
    "r3": Walker(
        [(0, 0), (0, 20), (-15, 20), (-15, 40), (0, 40), (0, 55), (8, 55)],
        110.0, math.radians(30.0), math.radians(0.04),
    ),
}  # fmt: skip


def exercise(seed: int, walkers: dict[str, Walker] | None = None) -> list[Heard]:
    """Return all that the nodes send, in the order in which it is heard."""
    walkers = WALKERS if walkers is None else walkers
    numbers = np.random.Generator(np.random.Philox(np.random.SeedSequence([seed, 4711])))
    paths = {name: _path(walker) for name, walker in walkers.items()}
    daps: dict[str, tuple[float, NDArray[np.float64]]] = {"dap1": (0.0, np.array([-0.9, 0.6]))}
    sent: list[Sent] = [(0.0, "dap", "dap1", installation(0.0, None, (-0.9, 0.6)))]
    for name, walker in walkers.items():
        time_s, place_m, corner = paths[name]
        sent += _strides(name, walker, paths[name], numbers)
        for index, dap_id in walker.installs.items():
            step = int(np.flatnonzero(corner == index)[0])
            down_s = float(time_s[step]) + 0.1
            daps[dap_id] = (down_s, place_m[step])
            sent.append((down_s, "dap", dap_id, installation(down_s, name)))
    for dap_id, (_, place_m) in daps.items():
        sent.append((0.0, "dap", dap_id, truth(0.0, place_m)))
    sent += _proximities(paths, daps, numbers)
    return _heard(sent)


def at_ns(time_s: float) -> int:
    """Return a time of the exercise on everybody's clock."""
    return START_NS + round(float(time_s) * 1e9)


def key_of(role: Role, node_id: str, message: type[Message]) -> Key:
    """Return the key that a node's messages of that type go under."""
    return Key(INCIDENT, role, node_id, _TOPIC[message])


def track_start(
    time_s: float, heading_sd_rad: float = 0.5, *, sequence: int = 0, placed: bool = True
) -> TrackStart:
    """Return a start at the origin, known to 0.3 m; or, not ``placed``, anywhere."""
    origin = LocalPosition(north_m=0.0, east_m=0.0, down_m=0.0, covariance_m2=(0.09, 0.0, 0.09))
    return TrackStart(
        event_time_ns=at_ns(time_s), sequence=sequence, position=origin if placed else None,
        heading_sd_rad=heading_sd_rad, mount="boot", method="linear_zupt",
    )  # fmt: skip


def stride(
    time_s: float, d_north_m: float, d_east_m: float, *, sequence: int = 0, d_down_m: float = 0.0
) -> OdometryIncrement:
    """Return a stride that ends at ``time_s``."""
    return OdometryIncrement(
        event_time_ns=at_ns(time_s), sequence=sequence, start_time_ns=at_ns(time_s - STRIDE_S),
        d_north_m=d_north_m, d_east_m=d_east_m, d_down_m=d_down_m, d_heading_rad=0.0,
        heading_rad=math.atan2(d_east_m, d_north_m), covariance=(0.0,) * 10, mount="boot",
    )  # fmt: skip


def installation(
    time_s: float,
    installer_id: str | None,
    place_m: tuple[float, float] | None = None,
    sequence: int = 0,
) -> DapInstallation:
    """Return what a DAP says of itself when it is set down."""
    position = place_m and LocalPosition(
        north_m=place_m[0], east_m=place_m[1], down_m=0.0, covariance_m2=(0.01, 0.0, 0.01)
    )
    return DapInstallation(
        event_time_ns=at_ns(time_s), sequence=sequence, installer_id=installer_id,
        position=position,
    )  # fmt: skip


def proximity(
    time_s: float, responder_id: str, *, phase: Phase = "near", sequence: int = 0
) -> ProximityEvent:
    """Return what a DAP says of somebody near."""
    return ProximityEvent(
        event_time_ns=at_ns(time_s), sequence=sequence, responder_id=responder_id,
        phase=phase, rssi_mean_dbm=-45.0, rssi_variance_db2=3.0, sample_count=15,
    )  # fmt: skip


def truth(time_s: float, place_m: Iterable[float], sequence: int = 0) -> Truth:
    """Return where somebody really is."""
    north_m, east_m = map(float, place_m)
    return Truth(
        event_time_ns=at_ns(time_s), sequence=sequence, north_m=north_m, east_m=east_m, down_m=0.0
    )


def _path(walker: Walker) -> Path:
    places, corners = [np.array(walker.corners_m[0], dtype=float)], [0]
    for index, corner in enumerate(walker.corners_m[1:], start=1):
        leg_m = np.array(corner) - places[-1]
        count = max(round(float(np.hypot(*leg_m)) / STRIDE_M), 1)
        places += [places[-1] + leg_m * (k + 1) / count for k in range(count)]
        corners += [0] * (count - 1) + [index]
    time_s = walker.start_s + 5.0 + STRIDE_S * np.arange(len(places), dtype=np.float64)
    return Path(time_s, np.array(places), np.array(corners))


def _strides(name: str, walker: Walker, path: Path, numbers: np.random.Generator) -> list[Sent]:
    time_s, place_m, _ = path
    first_deg = 3.0 if name == "r1" else 30.0
    start = track_start(walker.start_s, math.radians(first_deg))
    sent: list[Sent] = [(walker.start_s, "responder", name, start)]
    jitter = np.cumsum(math.radians(0.4) * numbers.standard_normal(len(time_s)))
    for k, (north, east) in enumerate(np.diff(place_m, axis=0)):
        elapsed_s = time_s[k + 1] - walker.start_s
        off = -(walker.offset_rad + walker.drift_rad_s * elapsed_s + jitter[k])
        moved = walker.scale * np.array([
            north * math.cos(off) - east * math.sin(off),
            north * math.sin(off) + east * math.cos(off),
        ]) + 0.02 * numbers.standard_normal(2)  # fmt: skip
        said = stride(time_s[k + 1], float(moved[0]), float(moved[1]), sequence=k)
        sent.append((float(time_s[k + 1]), "responder", name, said))
    sent += [
        (float(t), "responder", name, truth(t, place, k))
        for k, (t, place) in enumerate(zip(time_s, place_m, strict=True))
    ]
    return sent


def _proximities(
    paths: dict[str, Path],
    daps: dict[str, tuple[float, NDArray[np.float64]]],
    numbers: np.random.Generator,
) -> list[Sent]:
    sent: list[Sent] = []
    for dap_id, (since_s, dap_m) in daps.items():
        near: list[tuple[float, str]] = []
        for name, (time_s, place_m, _) in paths.items():
            tick_s = np.arange(math.ceil(time_s[0]), time_s[-1]) + 0.3
            place = np.stack([np.interp(tick_s, time_s, axis) for axis in place_m.T], axis=1)
            range_m = np.hypot(*(place - dap_m).T) + 0.4 * numbers.standard_normal(len(tick_s))
            near += [(float(t), name) for t in tick_s[(range_m < NEAR_M) & (tick_s > since_s + 1)]]
        sent += [
            (t, "dap", dap_id, proximity(t, name, sequence=k))
            for k, (t, name) in enumerate(sorted(near))
        ]
    return sent


def _heard(sent: list[Sent]) -> list[Heard]:
    heard = [
        Heard(at_ns(time_s + UPLINK_S), str(key_of(role, node, type(message))), encode(message))
        for time_s, role, node, message in sent
    ]
    return sorted(heard)
