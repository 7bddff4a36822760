"""Is the simulated boot like a real one? Prints what both show, stride by stride.

    python -m shared.simulation.gait_figures --recordings FOLDER

``FOLDER`` holds recordings of boot sensors with every stride marked: ``.npz`` files with ``t_s``,
``acc_m_s2``, ``gyr_rad_s``, ``truth_stride_index`` and ``truth_stride_xy_m``. Without it only the
simulated ones are printed.
"""

from __future__ import annotations

from collections import defaultdict
from itertools import pairwise
from pathlib import Path
from typing import TypeAlias

import cyclopts
import msgspec
import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table
from scipy.ndimage import uniform_filter1d

from shared.simulation.boot_imu import simulate_boot_imu
from shared.simulation.inertial_reading import GRAVITY_M_S2
from shared.simulation.scenario import Scenario, load_scenario
from shared.simulation.walker import simulate_walk

Array: TypeAlias = NDArray[np.float64]

FIGURES = ("peak force, g", "peak rate, °/s", "rate at stance, °/s", "stance, s", "least T")
RATE_HZ = 200.0
"""Of the real recordings; the simulated ones are made to match."""
STANCE_WINDOW_S = 0.045
STANCE_BELOW = 0.3
SEARCH_S = 0.25
SHORTEST_M = 0.4
"""Turning on the spot and kneeling down are not strides of their gait."""
WALK_BELOW_M_S = 1.55
FAST_BELOW_M_S = 2.15


def stance_statistic(force_m_s2: Array, rate_rad_s: Array, rate_hz: float) -> Array:
    """Return the SHOE statistic T (n,) over a centred window of 45 ms.

    ``mean|f − g·f̄/|f̄||² / 9.03² + mean|ω|² / 0.804²`` (Skog et al., "Zero-velocity detection: an
    algorithm evaluation", 2010), its noise levels chosen so that about 1 separates walking's
    stances from its swings.
    """
    size = max(3, round(STANCE_WINDOW_S * rate_hz) | 1)
    mean_force = np.linalg.norm(uniform_filter1d(force_m_s2, size, axis=0), axis=1)
    square = uniform_filter1d((force_m_s2**2).sum(axis=1), size)
    rest = square - 2.0 * GRAVITY_M_S2 * mean_force + GRAVITY_M_S2**2
    turning = uniform_filter1d((rate_rad_s**2).sum(axis=1), size)
    return np.asarray(np.maximum(rest, 0.0) / 9.03**2 + turning / 0.804**2)


def stride_figures(
    force_m_s2: Array, rate_rad_s: Array, rate_hz: float, ends: NDArray[np.intp]
) -> Array:
    """Return ``FIGURES`` (k - 1, 5) of the strides between the stances at samples ``ends`` (k,).

    A stride's stance is the one it ends in, where T is least within a quarter of a second.
    """
    statistic = stance_statistic(force_m_s2, rate_rad_s, rate_hz)
    force_g = np.linalg.norm(force_m_s2, axis=1) / GRAVITY_M_S2
    rate_deg_s = np.degrees(np.linalg.norm(rate_rad_s, axis=1))
    moving = np.append(np.flatnonzero(statistic >= STANCE_BELOW), len(statistic))
    search = round(SEARCH_S * rate_hz)
    rows = []
    for start, end in pairwise(ends):
        first = max(end - search, 0)
        still = first + int(np.argmin(statistic[first : end + search]))
        k = int(np.searchsorted(moving, still))
        before = moving[k - 1] if k else -1
        stance_s = (moving[k] - before - 1) / rate_hz if moving[k] != still else 0.0
        peaks = force_g[start:end].max(), rate_deg_s[start:end].max()
        rows.append((*peaks, rate_deg_s[still], stance_s, statistic[still]))
    return np.array(rows)


def simulated_figures(scenario: Scenario, seeds: range) -> dict[str, Array]:
    """Return the figures of all strides, by gait, of all responders of the scenario."""
    imu = msgspec.structs.replace(scenario.imu, rate_hz=RATE_HZ)
    scenario = msgspec.structs.replace(scenario, imu=imu)
    found = defaultdict(list)
    for seed in seeds:
        for responder_id in scenario.responders:
            walk = simulate_walk(scenario, responder_id, seed)
            boot = simulate_boot_imu(scenario, responder_id, seed)
            ends = np.searchsorted(boot.time_s, walk.stance_time_s)
            rows = stride_figures(boot.force_m_s2, boot.rate_rad_s, RATE_HZ, ends)
            for gait, length_m, row in zip(walk.gaits, walk.stride_m, rows, strict=True):
                if length_m > SHORTEST_M:
                    found[str(gait)].append(row)
    return {gait: np.array(rows) for gait, rows in found.items()}


def recorded_figures(folder: Path) -> dict[str, Array]:
    """Return the figures of the recordings in ``folder``, walking and fast walking by speed."""
    found = defaultdict(list)
    for path in sorted(folder.glob("*.npz")):
        with np.load(path) as recording:
            time_s, ends = recording["t_s"], recording["truth_stride_index"]
            force, rate = recording["acc_m_s2"], recording["gyr_rad_s"]
            way_m = np.hypot(*np.diff(recording["truth_stride_xy_m"], axis=0).T).sum()
        speed_m_s = way_m / (time_s[ends[-1]] - time_s[ends[0]])
        if speed_m_s < FAST_BELOW_M_S:
            gait = "walk" if speed_m_s < WALK_BELOW_M_S else "fast_walk"
            rate_hz = 1.0 / float(np.median(np.diff(time_s)))
            found[gait].append(stride_figures(force, rate, rate_hz, ends))
    return {gait: np.concatenate(parts) for gait, parts in found.items()}


def main(scenario: str = "course", *, seeds: int = 2, recordings: Path | None = None) -> None:
    """Print the 10th, 50th and 90th percentile of each figure.

    Parameters
    ----------
    scenario
        Whose responders to simulate.
    seeds
        How often.
    recordings
        Folder of real recordings to show beside.


    """
    table = Table("gait", "strides", *FIGURES)
    tables = {"simulated": simulated_figures(load_scenario(scenario), range(seeds))}
    if recordings is not None:
        tables["recorded"] = recorded_figures(recordings)
    for origin, figures in tables.items():
        for gait, rows in sorted(figures.items()):
            spread = np.percentile(rows, (10.0, 50.0, 90.0), axis=0).T
            cells = ["/".join(f"{value:.3g}" for value in column) for column in spread]
            table.add_row(f"{gait}, {origin}", str(len(rows)), *cells)
    Console(width=150).print(table)


if __name__ == "__main__":
    cyclopts.run(main)
