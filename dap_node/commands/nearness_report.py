"""Tables of how far away people are when a DAP tells of them."""

from __future__ import annotations

from rich.console import Console
from rich.table import Table

from dap_node.evaluation import LinkTrial, ProximityScore, score
from dap_node.peak_score import BIN_DB, FALSE_M, STRONG_DBM, PeakScore, score_peaks


def print_nearness(console: Console, title: str, trials: list[LinkTrial], pass_m: float) -> None:
    """Print what ``trials`` (n ≥ 1) come to; who comes within ``pass_m`` passes the DAP."""
    near, peaks = score(trials), score_peaks(trial.peaks for trial in trials)
    console.print(_proximity_table(title, near, pass_m))
    console.print(_peak_table("peaks", peaks, pass_m))
    console.print(_range_table("range at the peak", peaks))


def nearness_object(trials: list[LinkTrial]) -> dict[str, object]:
    """Return the same as a JSON object."""
    near, peaks = score(trials), score_peaks(trial.peaks for trial in trials)
    return {
        "proximity": near._asdict(),
        "peaks": {**peaks._asdict(), "bins": [one._asdict() for one in peaks.bins]},
    }


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
