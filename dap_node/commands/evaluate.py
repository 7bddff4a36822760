"""``dap-node evaluate``: how near 'near' is."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import msgspec
import structlog
from cyclopts import Parameter, validators
from rich.console import Console
from rich.progress import track
from rich.table import Table

from dap_node.evaluation import LinkTrial, ProximityScore, score, try_dap
from dap_node.peak_score import BIN_DB, FALSE_M, STRONG_DBM, PeakScore, score_peaks
from dap_node.settings import DapSettings
from dap_node.true_range import PASS_M
from shared.config import load_toml
from shared.exercise import seeds_in
from shared.process import ExitCode
from shared.simulation.scenario import load_scenario

_log = structlog.stdlib.get_logger(__name__)


def evaluate(
    scenario: str,
    *,
    seeds: str = "0-9",
    config: Path | None = None,
    within: Annotated[float, Parameter(validator=validators.Number(gt=0.0))] = PASS_M,
    json: bool = False,
) -> int:
    """Measure how far from the DAP responders are when it tells of them.

    Example: dap-node evaluate four_daps --seeds 0-19

    Parameters
    ----------
    scenario
        A packaged scenario's name, or a TOML file.
    seeds
        One seed, or the first and the last: 0-9.
    config
        TOML file with offset_db, [proximity] and [peaks].
    within
        Who comes within so many metres passes the DAP.
    json
        Print one JSON object, and no table.

    """
    try:
        loaded = load_scenario(scenario)
        settings = load_toml(config, DapSettings) if config else DapSettings()
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
        for trial in try_dap(loaded, dap_id, seed, settings, within)
    ]
    _show(f"{scenario}, seeds {seeds}", trials, within, json=json)
    return ExitCode.OK


def _show(title: str, trials: list[LinkTrial], pass_m: float, *, json: bool) -> None:
    near, peaks = score(trials), score_peaks(trial.peaks for trial in trials)
    if json:
        told = {"proximity": near._asdict(), "peaks": peaks._asdict()}
        told["peaks"]["bins"] = [one._asdict() for one in peaks.bins]
        sys.stdout.write(msgspec.json.encode(told).decode() + "\n")
        return
    console = Console()
    console.print(_proximity_table(title, near, pass_m))
    console.print(_peak_table("peaks", peaks, pass_m))
    console.print(_range_table("range at the peak", peaks))


def _proximity_table(title: str, told: ProximityScore, pass_m: float) -> Table:
    table = Table("", "", title=title, show_header=False)
    table.add_row(f"passes within {pass_m:g} m", f"{told.passes}")
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


def _peak_table(title: str, told: PeakScore, pass_m: float) -> Table:
    table = Table("", "", title=title, show_header=False)
    table.add_row(f"passes within {pass_m:g} m", f"{told.passes}")
    table.add_row("with a peak, peaks in them", f"{told.noticed}, {told.in_passes}")
    table.add_row(
        "after the nearest by, median, 95 % either way",
        f"{told.off_p50_s:+.2f} s, {told.off_abs_p95_s:.2f} s",
    )
    table.add_row("told after, median", f"{told.delay_p50_s:.1f} s")
    table.add_row("peaks told", f"{told.peaks}")
    table.add_row(
        f"from {STRONG_DBM:.0f} dBm, of these beyond {FALSE_M:g} m",
        f"{told.strong}, {told.strong_false}",
    )
    return table


def _range_table(title: str, told: PeakScore) -> Table:
    table = Table(
        "peak, dBm", "peaks", "median, m", "95 %, m", "σ, m", "σ by median, m", title=title
    )
    for one in told.bins:
        table.add_row(
            f"{one.from_dbm} to {one.from_dbm + BIN_DB}",
            f"{one.peaks}",
            *(f"{value:.2f}" for value in one[2:]),
        )
    return table
