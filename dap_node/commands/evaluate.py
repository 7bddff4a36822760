"""``dap-node evaluate``: how near 'near' is."""

from __future__ import annotations

from pathlib import Path

import structlog
from rich.console import Console
from rich.progress import track
from rich.table import Table

from dap_node.evaluation import ProximityScore, score, try_dap
from dap_node.proximity import ProximitySettings
from shared.config import load_toml
from shared.exercise import seeds_in
from shared.process import ExitCode
from shared.simulation.scenario import load_scenario

_log = structlog.stdlib.get_logger(__name__)


def evaluate(scenario: str, *, seeds: str = "0-9", proximity: Path | None = None) -> int:
    """Measure how far from the DAP responders are when it says that they are near.

    Example: dap-node evaluate four_daps --seeds 0-19

    Parameters
    ----------
    scenario
        A packaged scenario's name, or a TOML file.
    seeds
        One seed, or the first and the last: 0-9.
    proximity
        TOML file with the thresholds of nearness.

    """
    try:
        loaded = load_scenario(scenario)
        settings = load_toml(proximity, ProximitySettings) if proximity else ProximitySettings()
        jobs = [(dap_id, seed) for seed in seeds_in(seeds) for dap_id in loaded.daps]
    except ValueError as error:
        _log.error(str(error))
        return ExitCode.USAGE
    if not jobs:
        _log.error(f"{scenario}: no DAP to evaluate; give a scenario that has one")
        return ExitCode.USAGE
    console = Console(stderr=True)
    trials = [
        trial
        for dap_id, seed in track(
            jobs, "measuring", console=console, transient=True, disable=not console.is_terminal
        )
        for trial in try_dap(loaded, dap_id, seed, settings)
    ]
    Console().print(_table(f"{scenario}, seeds {seeds}", score(trials)))
    return ExitCode.OK


def _table(title: str, told: ProximityScore) -> Table:
    table = Table("", "", title=title, show_header=False)
    table.add_row("passes within 1.5 m", f"{told.passes}")
    table.add_row("of these noticed", f"{told.noticed}")
    table.add_row("stays told", f"{told.stays}")
    table.add_row(
        "entering at, median, 95 %", f"{told.entered_p50_m:.1f} m, {told.entered_p95_m:.1f} m"
    )
    table.add_row("events told", f"{told.events}")
    table.add_row(
        "at, median, 90 %, 95 %", f"{told.p50_m:.1f} m, {told.p90_m:.1f} m, {told.p95_m:.1f} m"
    )
    table.add_row("beyond 3 m, 5 m", f"{told.beyond_3_m:.1%}, {told.beyond_5_m:.1%}")
    return table
