"""What the simulated radio is like, range by range, to hold beside measurements.

``python -m shared.simulation.radio_figures --scenario four_daps --seeds 5``
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from cyclopts import App
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from shared.simulation.installation import is_set_down
from shared.simulation.radio import RadioChannel
from shared.simulation.scenario import Scenario, load_scenario
from shared.simulation.walker import simulate_walk

Array: TypeAlias = NDArray[np.float64]

RANGES_M = (0.0, 1.0, 2.0, 3.0, 4.0, 6.0, 8.0, 12.0, 16.0, 24.0, 40.0, 80.0)
WINDOW_S = 2.0
STILL_M_S, WALKING_M_S = 0.02, 0.5

HEADINGS = (
    "range, m",
    "windows",
    "mean, dBm",
    "across places, dB",
    "walking, dB²",
    "standing, dB²",
    "lost",
)

app = App(name="radio-figures", help=__doc__)


class RangeRow(NamedTuple):
    """Signal strength within a span of horizontal ranges (m), over windows of 2 s.

    Mean (dBm) of the windows' means and their spread from place to place (dB); median variance
    within a window while walking, and while standing (dB²; NaN if nobody did); and the share of
    scans that were lost.
    """

    from_m: float
    to_m: float
    windows: int
    mean_dbm: float
    across_places_db: float
    walking_variance_db2: float
    standing_variance_db2: float
    lost: float


def range_rows(scenario: Scenario, seeds: range) -> list[RangeRow]:
    """Sum up all links of ``scenario`` in the exercises of ``seeds``."""
    windows = np.concatenate(
        [
            _windows(scenario, dap_id, responder_id, seed)
            for seed in seeds
            for dap_id in scenario.daps
            if is_set_down(scenario, dap_id, seed)
            for responder_id in scenario.responders
        ]
    )
    rows = [_row(windows, from_m, to_m) for from_m, to_m in pairwise(RANGES_M)]
    return [row for row in rows if row.windows]


def _windows(scenario: Scenario, dap_id: str, responder_id: str, seed: int) -> Array:
    """Return range, speed, RSSI mean and variance, scans and readings of each window (w, 6)."""
    channel = RadioChannel(scenario, dap_id, responder_id, seed)
    body = simulate_walk(scenario, responder_id, seed).body
    heard_s, rssi_dbm = channel.readings()
    scan_s = channel.scan_times_s(channel.end_s)
    edges_s = np.arange(max(body.time_s[0], scan_s[0]), channel.end_s, WINDOW_S)
    place_m = body.at(edges_s)[0]
    middle_m = body.at(edges_s[:-1] + 0.5 * WINDOW_S)[0]
    range_m = np.linalg.norm((middle_m - channel.dap_m)[:, :2], axis=1)
    speed_m_s = np.linalg.norm(np.diff(place_m, axis=0), axis=1) / WINDOW_S
    scans = np.histogram(scan_s, edges_s)[0]
    within = np.split(rssi_dbm, np.searchsorted(heard_s, edges_s))[1:-1]
    mean_dbm = [values.mean() if len(values) else np.nan for values in within]
    variance_db2 = [values.var() if len(values) > 1 else np.nan for values in within]
    readings = [len(values) for values in within]
    return np.column_stack([range_m, speed_m_s, mean_dbm, variance_db2, scans, readings])


def _row(windows: Array, from_m: float, to_m: float) -> RangeRow:
    here = windows[(windows[:, 0] >= from_m) & (windows[:, 0] < to_m)]
    _, speed_m_s, mean_dbm, variance_db2, scans, readings = here.T
    return RangeRow(
        from_m,
        to_m,
        len(here),
        _of_known(np.mean, mean_dbm),
        _of_known(np.std, mean_dbm),
        _of_known(np.median, variance_db2[speed_m_s > WALKING_M_S]),
        _of_known(np.median, variance_db2[speed_m_s < STILL_M_S]),
        float(1.0 - readings.sum() / scans.sum()) if len(here) else np.nan,
    )


def _of_known(sum_up: Callable[[Array], np.floating[Any]], values: Array) -> float:
    known = values[~np.isnan(values)]
    return float(sum_up(known)) if len(known) else np.nan


@app.default
def show(*, scenario: str = "four_daps", seeds: int = 5) -> None:
    """Print the table for the links of a scenario.

    Parameters
    ----------
    scenario
        A packaged scenario's name, or a TOML file.
    seeds
        How many exercises to sum up.

    """
    table = Table(*HEADINGS, title=f"{scenario}, {seeds} exercises")
    for row in range_rows(load_scenario(scenario), range(seeds)):
        table.add_row(
            f"{row.from_m:.0f} to {row.to_m:.0f}",
            f"{row.windows}",
            f"{row.mean_dbm:.1f}",
            f"{row.across_places_db:.1f}",
            _or_nothing(row.walking_variance_db2),
            _or_nothing(row.standing_variance_db2),
            f"{row.lost:.0%}",
        )
    Console().print(table)


def _or_nothing(value: float) -> str:
    return "" if np.isnan(value) else f"{value:.1f}"


if __name__ == "__main__":
    app()
