"""Real radio: readings of a carried beacon at fixed receivers, and a simulated boot on its way."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from command_post.proof.trial import RESPONDER, Heard, Trial, peaks_told, stands_at
from shared.exercise import REHEARSAL_START_NS
from shared.messages import LocalPosition, TrackStart
from shared.rssi_peaks import PeakSettings
from shared.simulation.chance import generator
from shared.simulation.odometry import as_increment, odometry_of
from shared.simulation.odometry_errors import OdometrySettings
from shared.simulation.retraced import walk_along
from shared.units import NS_PER_S
from shared.walk_by import WalkBy

Floats: TypeAlias = NDArray[np.float64]

BEGIN_S = 3.0
PAUSE_S = 8.0
_NED_FROM_Z_UP = np.array([1.0, -1.0, -1.0])


def radio_trial(
    name: str, recording: WalkBy, offset_db: float, heading_sd_deg: float, seed: int
) -> Trial:
    """Return the trial of one recording: every receiver a DAP at its place, all of them known.

    ``offset_db`` brings its readings to the product's scale. The boot's errors are those of
    ``OdometrySettings``; of its heading it knows as much as ``heading_sd_deg`` says.
    """
    chance = generator(seed, "proof of radio", name)
    _, rows = np.unique(recording.time_s, return_index=True)
    time_s = recording.time_s[rows]
    beacon_m = recording.beacon_m[rows] * _NED_FROM_Z_UP
    beacon_m[:, 2] = 0.0
    heard = list(_boot(time_s, beacon_m, math.radians(heading_sd_deg), chance))
    for receiver, place_m in enumerate(recording.receiver_m * _NED_FROM_Z_UP):
        dap_id = f"dap{receiver + 1}"
        own = recording.receiver == receiver
        heard.append(stands_at(place_m[:2], dap_id))
        heard += peaks_told(
            dap_id,
            recording.time_s[own] + BEGIN_S,
            recording.rssi_dbm[own] + offset_db,
            float(time_s[-1]) + BEGIN_S + PAUSE_S,
            PeakSettings(),
        )
    seconds = np.arange(0.0, time_s[-1])
    truth_m = np.column_stack([np.interp(seconds, time_s, axis) for axis in beacon_m.T[:2]])
    return Trial(name, heard, seconds + BEGIN_S + REHEARSAL_START_NS / NS_PER_S, truth_m)


def recordings_at(paths: list[str]) -> list[Path]:
    """Return the ``.npz`` files that ``paths`` name; ``ValueError`` if one names none."""
    found = []
    for path in map(Path, paths):
        files = sorted(path.glob("*.npz")) if path.is_dir() else [path]
        if not files:
            raise ValueError(f"{path}: no .npz file in it; give a folder that has some")
        found += files
    return found


def _boot(
    time_s: Floats, beacon_m: Floats, heading_sd_rad: float, chance: np.random.Generator
) -> Iterator[Heard]:
    settings = OdometrySettings()
    off_m = settings.start_m * chance.normal(size=2)
    start = LocalPosition(
        north_m=float(beacon_m[0, 0] + off_m[0]),
        east_m=float(beacon_m[0, 1] + off_m[1]),
        down_m=0.0,
        covariance_m2=(settings.start_m**2, 0.0, settings.start_m**2),
    )
    begin_ns = _time_ns(-1.0)
    said = TrackStart(
        event_time_ns=begin_ns, sequence=0, position=start, heading_sd_rad=heading_sd_rad,
        mount="boot", method="strides",
    )  # fmt: skip
    yield Heard(begin_ns, "responder", RESPONDER, said)
    walk = walk_along(time_s, beacon_m, chance)
    for number, stride in enumerate(odometry_of(walk, settings, heading_sd_rad, chance)):
        end_ns = _time_ns(stride.end_s)
        told = as_increment(stride, _time_ns(stride.start_s), end_ns, number)
        yield Heard(end_ns, "responder", RESPONDER, told)


def _time_ns(time_s: float) -> int:
    return REHEARSAL_START_NS + round((time_s + BEGIN_S) * NS_PER_S)
