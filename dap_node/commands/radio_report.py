"""Tables of what a real radio says of range, and of two rules for nearness beside each other."""

from __future__ import annotations

import math
from typing import NamedTuple

from rich.console import Console
from rich.table import Table

from dap_node.comparison import Beside, Comparison, Point, Row
from dap_node.detector_score import FALSE_RANGE, DetectorScore
from dap_node.evaluation import LinkTrial
from dap_node.measured import Measured
from dap_node.radio_survey import Interval, Survey

SCORE_COLUMNS = (
    "missed", "false stays, s /h", "range at entering, m", "told after, s",
)  # fmt: skip
AT_RATE, AT_MISSES = " likelihood, as many false", " likelihood, as few missed"


class Kind(NamedTuple):
    """All recordings of one kind: what each says, all together, and how detectors did on them.

    ``offset_db`` brings them to the product's scale; who comes within ``near_m`` passes a receiver.
    """

    name: str
    surveys: list[tuple[Measured, Survey]]
    together: Survey
    offset_db: float
    near_m: float
    comparison: Comparison
    trials: list[LinkTrial]


def print_kind(console: Console, kind: Kind) -> None:
    """Print all that was measured but for the nearness of ``kind.trials``."""
    console.print(_fit_table(kind))
    console.print(_range_table(kind.together))
    console.print(_point_table(kind))
    console.print(
        _recording_table("each recording, rules as in the first rows", kind.comparison.each)
    )
    if kind.comparison.left_out:
        title = "each recording, thresholds chosen on the others"
        console.print(_recording_table(title, kind.comparison.left_out))


def kind_object(kind: Kind) -> dict[str, object]:
    """Return the same as a JSON object."""
    return {
        "kind": kind.name,
        "recordings": [
            {"name": one.name, "survey": _plain(survey)} for one, survey in kind.surveys
        ],
        "together": _plain(kind.together),
        "offset_db": kind.offset_db,
        "near_m": kind.near_m,
        "comparison": _plain(kind.comparison),
    }


def _plain(value: object) -> object:
    """Return ``value`` with its named tuples as dictionaries."""
    if isinstance(value, tuple) and hasattr(value, "_asdict"):
        return {name: _plain(each) for name, each in value._asdict().items()}
    if isinstance(value, (list, tuple)):
        return [_plain(each) for each in value]
    return value


def _fit_table(kind: Kind) -> Table:
    table = Table(
        "recording", "readings", "at 1 m, dBm", "exponent (95 %)", "σ, dB (95 %)",
        "σ at a place", "across places", "variance with range",
        title=f"{kind.name}: path loss and spread; {kind.offset_db:+.1f} dB to the usual scale",
    )  # fmt: skip
    named = [(one.name, survey) for one, survey in kind.surveys]
    for name, survey in [*named, ("together", kind.together)]:
        fit = survey.fit
        table.add_row(
            name,
            f"{survey.readings}",
            f"{fit.power_at_1_m_dbm:.1f}",
            f"{fit.exponent:.2f} ({_interval(fit.exponent_interval, 2)})",
            f"{fit.sigma_db:.1f} ({_interval(fit.sigma_interval_db, 1)})",
            f"{survey.same_place_db:.1f}",
            f"{survey.across_places_db:.1f}",
            f"{survey.variance_correlation:+.2f}",
        )
    return table


def _range_table(together: Survey) -> Table:
    table = Table(
        "range, m", "readings", "mean, dBm", "σ across places, dB",
        "variance at a place, dB²", "median", title="against range",
    )  # fmt: skip
    for one in together.bins:
        table.add_row(
            f"{one.from_m:g} to {one.to_m:.3g}",
            f"{one.readings}",
            f"{one.mean_dbm:.1f}",
            *(_number(value) for value in one[4:]),
        )
    return table


def _point_table(kind: Kind) -> Table:
    comparison = kind.comparison
    passes = comparison.configured.published.score.passes
    table = Table(
        "rule", "threshold", *SCORE_COLUMNS,
        title=f"{passes} passes within {kind.near_m:g} m, "
        f"false beyond {FALSE_RANGE * kind.near_m:g} m",
    )  # fmt: skip
    _add_row(table, comparison.configured, "published, as set")
    _add_point(table, "likelihood, as set", comparison.likelihood)
    table.add_section()
    for row in comparison.rows:
        _add_row(table, row, "published")
    return table


def _add_row(table: Table, row: Row, name: str) -> None:
    _add_point(table, name, row.published)
    _add_point(table, AT_RATE, row.at_rate)
    _add_point(table, AT_MISSES, row.at_misses)


def _add_point(table: Table, name: str, point: Point | None) -> None:
    if point is None:
        table.add_row(name, "none", *("" for _ in SCORE_COLUMNS))
    else:
        table.add_row(name, f"{point.threshold:g}", *_cells(point.score))


def _recording_table(title: str, every: list[Beside]) -> Table:
    table = Table("recording", "rule", "passes", *SCORE_COLUMNS, title=title)
    for one in every:
        passes = f"{one.published.passes}"
        table.add_row(one.recording, "published", passes, *_cells(one.published))
        table.add_row("", AT_RATE, "", *_cells(one.at_rate))
        table.add_row("", AT_MISSES, "", *_cells(one.at_misses))
    return table


def _cells(score: DetectorScore) -> tuple[str, ...]:
    return (
        f"{score.missed}",
        f"{score.false_stays_per_h:.0f}, {score.false_events_per_h:.0f}",
        f"{_number(score.range_p50_m)}, 95 % {_number(score.range_p95_m)}",
        f"{_number(score.delay_p50_s)}, 95 % {_number(score.delay_p95_s)}",
    )


def _interval(interval: Interval, places: int) -> str:
    low, high = interval
    return f"{low:.{places}f} to {high:.{places}f}"


def _number(value: float) -> str:
    return "-" if math.isnan(value) else f"{value:.1f}"
