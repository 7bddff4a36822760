"""A picture of a Monte Carlo: how errors are distributed, beside the tracks of one of its runs."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple, TypeAlias

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from command_post.evaluation.errors import MethodErrors, RunErrors
from command_post.evaluation.evidence import Evidence
from command_post.rehearsing.picture import COLOURS, DOTS_PER_INCH, draw_map, save
from shared.simulation.plan import Plan

Floats: TypeAlias = NDArray[np.float64]

ROW_IN = (14.0, 4.6)
FURTHEST_PERCENT = 99.0
"""Errors are drawn up to this percentile of what was tracked live: dead reckoning runs off."""


class Drawn(NamedTuple):
    """A scenario to be drawn: all its runs' errors, and one run with the building it was in."""

    name: str
    runs: list[RunErrors]
    sample: Evidence
    plan: Plan


def draw_monte_carlo(scenarios: Sequence[Drawn], path: Path) -> None:
    """Draw a row for each scenario as a PNG at ``path``, which is replaced whole or not at all.

    On the left the share of seconds with an absolute error below so many metres, and dashed that
    with the team turned as one; on the right the run's tracks.
    """
    width_in, height_in = ROW_IN
    size_in = (width_in, height_in * len(scenarios))
    figure = Figure(figsize=size_in, dpi=DOTS_PER_INCH, layout="constrained")
    rows = figure.subplots(len(scenarios), 2, squeeze=False, width_ratios=(1.0, 1.6))
    for (shares, tracks), scenario in zip(rows, scenarios, strict=True):
        _draw_shares(shares, scenario)
        entries = draw_map(tracks, scenario.sample, scenario.plan)
        tracks.legend(handles=entries, fontsize=7, frameon=False, loc="upper left",
                      bbox_to_anchor=(1.0, 1.0))  # fmt: skip
    save(figure, path)


def _draw_shares(axes: Axes, scenario: Drawn) -> None:
    ways = {
        "dead reckoning alone": [run.pdr for run in scenario.runs],
        "fused live": [run.live for run in scenario.runs],
        "afterwards": [run.after for run in scenario.runs if run.after is not None],
    }
    for (label, runs), colour in zip(ways.items(), COLOURS, strict=False):
        absolute_m, team_m = _sorted(runs, team=False), _sorted(runs, team=True)
        if absolute_m.size:
            axes.plot(absolute_m, _shares(absolute_m), color=colour, label=label)
            axes.plot(team_m, _shares(team_m), color=colour, linestyle="--", linewidth=1.0)
    live_m = _sorted(ways["fused live"], team=False)
    if live_m.size:
        axes.set_xlim(0.0, max(float(np.percentile(live_m, FURTHEST_PERCENT)), 1.0))
    axes.set_ylim(0.0, 1.0)
    axes.set_yticks([0.0, 0.25, 0.5, 0.75, 0.95])
    axes.set_title(f"{scenario.name}, {len(scenario.runs)} runs", fontsize=10)
    axes.set_xlabel("horizontal error (m); dashed: team turned as one")
    axes.set_ylabel("share of seconds")
    axes.grid(color="#e4e4e4", linewidth=0.5)
    if axes.lines:
        axes.legend(loc="lower right", frameon=False, fontsize=8)


def _sorted(runs: Sequence[MethodErrors], *, team: bool) -> Floats:
    tracks = [track for run in runs for track in run.responders.values()]
    parts = [track.team_m if team else track.absolute_m for track in tracks]
    return np.sort(np.concatenate([np.empty(0), *parts]))


def _shares(sorted_m: Floats) -> Floats:
    return np.arange(1, len(sorted_m) + 1) / len(sorted_m)
