"""A score card for people to read."""

from __future__ import annotations

from collections.abc import Mapping

from rich.console import Console
from rich.table import Table

from edge_agent.evaluation.score_card import METRICS, ScoreCard
from shared.maths.statistics import Summary
from shared.messages import Mount

PIPED_WIDTH = 240
"""Columns when standard output is no terminal: nothing may be cut off."""

WHOLE_FROM = 10_000.0
"""Larger numbers are told without decimals."""

_HEADINGS = {
    "distance_error_pct": "distance %",
    "distance_3d_error_pct": "distance 3-D %",
    "taped_error_pct": "taped %",
    "stride_rmse_m": "stride m",
    "ate_pct": "ATE %",
    "end_error_pct": "end %",
    "heading_drift_deg_min": "drift °/min",
    "missed_stances_pct": "missed %",
    "false_stances_pct": "false %",
    "coverage95_pct": "in ellipse %",
    "coverage95_whole_path_pct": "in ellipse, whole path %",
    "vertical_rmse_m": "height m",
    "vertical_end_error_m": "height end m",
    "vertical_increment_rmse_m": "height, increment m",
    "vertical_coverage95_pct": "height in 95 % %",
    "floor_rmse_m": "floor m",
    "closure_2d_m": "closure m",
    "closure_3d_m": "closure 3-D m",
    "worst_m": "worst m",
    "steps_error_pct": "steps %",
    "steps_off": "steps off",
    "steps_exact_pct": "exact %",
    "off_setting_out": "off, start",
    "off_way": "off, way",
    "off_turn": "off, turn",
    "off_arriving": "off, stop",
    "off_arrived": "off, after",
    "steps_as_feet_pct": "as feet %",
    "marks_as_feet_pct": "marks as feet %",
    "speed_rmse_m_s": "speed m/s",
    "speed_live_rmse_m_s": "speed live m/s",
    "realignment_s": "re-aligned s",
    "acceleration_rmse_m_s2": "acceleration m/s²",
    "acceleration_correlation": "correlation",
    "samples_per_s": "samples/s",
}


_DEGRADED_HEADINGS = {
    "distance_error_pct": "distance %",
    "end_error_pct": "end %",
    "vertical_end_error_m": "height end m",
}

_WORN_DEGRADED_HEADINGS = {
    metric: _HEADINGS[metric]
    for metric in (
        "distance_error_pct",
        "steps_error_pct",
        "ate_pct",
        "closure_2d_m",
        "speed_rmse_m_s",
        "realignment_s",
    )
}


def print_tables(card: ScoreCard, title: str) -> None:
    """Write the trials, the failures and the sets of ``card`` to standard output."""
    console = _console()
    told = [metric for metric in METRICS if any(metric in row for row in card.sets.values())]
    console.print(_trials(card, told, title))
    for row in card.trials:
        if row.failure is not None:
            console.print(f"failed: {row.set} {row.name}: {row.failure}", markup=False)
    console.print(_sets(card, title))


def print_degraded(cards: Mapping[str, ScoreCard], title: str, mount: Mount) -> None:
    """Write one table: a row a degradation, the median errors of each set of ``cards``."""
    headings = _DEGRADED_HEADINGS if mount == "boot" else _WORN_DEGRADED_HEADINGS
    table = Table(title=f"Degraded, medians ({title})", title_justify="left")
    table.add_column("degradation", no_wrap=True)
    columns = [
        (name, metric)
        for name in sorted({name for card in cards.values() for name in card.sets})
        for metric in headings
        if any(metric in card.sets.get(name, {}) for card in cards.values())
    ]
    for name, metric in columns:
        heading = f"{name}/{headings[metric]}".replace("/", "/\n")
        table.add_column(heading, justify="right")
    for degradation, card in cards.items():
        table.add_row(degradation, *(_median(card, *column) for column in columns))
    _console().print(table)


def _console() -> Console:
    console = Console()
    return console if console.is_terminal else Console(width=PIPED_WIDTH)


def _median(card: ScoreCard, name: str, metric: str) -> str:
    """Return a set's median; with the trials that failed, which are not in it."""
    summaries = card.sets[name]
    summary = summaries.get(metric)
    told = _told(summary.median) if isinstance(summary, Summary) else "none"
    failed = summaries["failed"]
    return f"{told} ({failed} failed)" if failed else told


def _trials(card: ScoreCard, told: list[str], title: str) -> Table:
    table = Table(title=f"Trials ({title})", title_justify="left")
    table.add_column("set", no_wrap=True)
    table.add_column("trial", no_wrap=True)
    fields = {
        "strides": "n_strides",
        "steps": "steps_true",
        "found": "steps_found",
        "by feet": "steps_by_feet",
        "odd marks": "contradictions",
        "slips": "slips",
    }
    counts = {heading: field for heading, field in fields.items() if _any(card, field)}
    for heading in (*counts, "length m", "m/s", *(_HEADINGS[metric] for metric in told)):
        table.add_column(heading, justify="right")
    for row in sorted(card.trials, key=lambda row: (row.set, row.name)):
        table.add_row(
            row.set,
            row.name,
            *("" if (n := getattr(row, field)) is None else str(n) for field in counts.values()),
            _told(row.length_m),
            _told(row.mean_speed_m_s),
            *(_told(getattr(row, metric)) for metric in told),
        )
    return table


def _any(card: ScoreCard, field: str) -> bool:
    return any(getattr(row, field) is not None for row in card.trials)


def _told(value: float | None) -> str:
    if value is None:
        return ""
    return f"{value:.2f}" if abs(value) < WHOLE_FROM else f"{value:,.0f}"


def _sets(card: ScoreCard, title: str) -> Table:
    table = Table(title=f"Sets, by magnitude ({title})", title_justify="left")
    table.add_column("set", no_wrap=True)
    for heading in ("trials", "failed"):
        table.add_column(heading, justify="right")
    table.add_column("error")
    for heading in Summary._fields:
        table.add_column(heading, justify="right")
    for name, summaries in card.sets.items():
        first = [name, str(summaries["n"]), str(summaries["failed"])]
        for metric, heading in _HEADINGS.items():
            summary = summaries.get(metric)
            if isinstance(summary, Summary):
                table.add_row(*first, heading, *map(_told, summary))
                first = ["", "", ""]
        if first[0]:
            table.add_row(*first)
        table.add_section()
    return table
