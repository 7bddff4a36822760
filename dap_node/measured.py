"""Real recordings with the truth, whatever their kind, as readings and links to measure on."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple, TypeAlias

import msgspec
import numpy as np
from numpy.typing import NDArray

from dap_node.detector_score import Link
from dap_node.proximity import ProximitySettings
from dap_node.radio_survey import RangedReadings
from dap_node.settings import DapSettings
from dap_node.true_range import TrueRange
from dap_node.wifi_grid import WifiGrid, read_wifi_grid, walk_over
from shared.rssi_peaks import PeakSettings
from shared.walk_by import WalkBy, offset_beside, read_walk_by

Array: TypeAlias = NDArray[np.float64]

CELL_M = 0.5
"""A place is a square of the floor of this side."""

LEAST_SPAN_M = 0.5
"""Where ranges differ by less, nothing is said of how power falls with range."""

READINGS_IN_WINDOW = 5.5
"""A window is to hold so many readings on average, some of which may be lost."""


class Measured(NamedTuple):
    """One recording: readings as heard, by slant range, and what each receiver heard on a walk.

    ``walk`` is the recording itself if it is one of a beacon carried by receivers.
    """

    name: str
    kind: str
    readings: RangedReadings
    links: list[Link]
    walk: WalkBy | None = None


def read_measured(path: Path) -> Measured:
    """Return the recording at ``path``; raise ``ValueError`` that says what is wrong with it."""
    if path.suffix == ".npz":
        measured = of_walk(path.stem, read_walk_by(path))
    else:
        name = path.name.removesuffix(".gz").removesuffix(".csv")
        measured = of_grid(name, read_wifi_grid(path))
    range_m = measured.readings.range_m
    if not range_m.size or np.ptp(range_m) < LEAST_SPAN_M:
        raise ValueError(f"{path}: all its readings are of one range; give a walk that comes near")
    if all(len(link.time_s) < READINGS_IN_WINDOW for link in measured.links):
        raise ValueError(f"{path}: too few readings of each receiver; give a longer one")
    return measured


def of_walk(name: str, walk: WalkBy) -> Measured:
    """Return a beacon's walk; a link's range is horizontal, from receiver to beacon."""
    cell = np.floor(walk.beacon_m[:, :2] / CELL_M).astype(np.int64)
    keys = np.column_stack([walk.receiver, cell])
    _, spot = np.unique(keys, axis=0, return_inverse=True)
    links = []
    for receiver, place_m in enumerate(walk.receiver_m):
        own = walk.receiver == receiver
        if own.any():
            range_m = np.linalg.norm((walk.beacon_m - place_m)[:, :2], axis=1)
            links.append(
                Link(name, walk.time_s[own], walk.rssi_dbm[own], TrueRange(walk.time_s, range_m))
            )
    readings = RangedReadings(walk.rssi_dbm, walk.slant_m, spot.ravel().astype(np.int64))
    return Measured(name, "walk by receivers", readings, links, walk)


def of_grid(name: str, grid: WifiGrid) -> Measured:
    """Return a room's grid; its links are of a walk over the points."""
    access_points = grid.rssi_dbm.shape[1]
    range_m = grid.range_m[grid.point]
    spot = grid.point[:, None] * access_points + np.arange(access_points)
    known = ~np.isnan(grid.rssi_dbm) & ~np.isnan(range_m)
    readings = RangedReadings(grid.rssi_dbm[known], range_m[known], spot[known])
    walks = [walk_over(grid, at) for at in range(access_points)]
    links = [
        Link(name, one.time_s, one.rssi_dbm, TrueRange(one.truth_s, one.range_m))
        for one in walks
        if len(one.time_s)
    ]
    return Measured(name, "grid of points", readings, links)


def offset_db(recordings: Sequence[Measured]) -> float:
    """Return what brings ``recordings`` to the product's scale: see ``offset_beside``."""
    range_m = np.concatenate([one.readings.range_m for one in recordings])
    return offset_beside(range_m, np.concatenate([one.readings.rssi_dbm for one in recordings]))


def calibrated(recordings: Sequence[Measured], given_db: float) -> list[Link]:
    """Return all links on the product's scale, each recording brought there by the others.

    One that has no other of its kind is by its own readings; ``given_db`` unless 0 is for all.
    """
    links = []
    for one in recordings:
        others = [other for other in recordings if other is not one and other.kind == one.kind]
        added_db = given_db or offset_db(others or [one])
        links += [link._replace(rssi_dbm=link.rssi_dbm + added_db) for link in one.links]
    return links


def paced(settings: DapSettings, recordings: Sequence[Measured]) -> DapSettings:
    """Return ``settings`` with windows as long as the recordings' pace of reading asks for."""
    gaps_s = [np.diff(link.time_s) for one in recordings for link in one.links]
    period_s = float(np.median(np.concatenate(gaps_s)))
    window_s = round(READINGS_IN_WINDOW * period_s, 1)
    if window_s <= settings.proximity.window_s:
        return settings
    return msgspec.structs.replace(
        settings,
        proximity=_slower(settings.proximity, window_s),
        peaks=_slower_peaks(settings.peaks, window_s),
    )


def _slower(settings: ProximitySettings, window_s: float) -> ProximitySettings:
    return msgspec.structs.replace(
        settings,
        window_s=window_s,
        least_samples=min(settings.least_samples, 3),
        silence_s=max(settings.silence_s, 2.0 * window_s),
    )


def _slower_peaks(settings: PeakSettings, window_s: float) -> PeakSettings:
    return msgspec.structs.replace(
        settings,
        window_s=window_s,
        middle_s=max(settings.middle_s, window_s),
        silence_s=max(settings.silence_s, 2.0 * window_s),
    )
