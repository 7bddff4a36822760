"""A picture of a run: tracks over the building, north up."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import cycle
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from command_post.evaluation.evidence import Evidence, Track
from shared.files import replace_atomically
from shared.simulation.plan import Plan

Floats: TypeAlias = NDArray[np.float64]

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
"""Colours that the colour-blind tell apart (Okabe and Ito 2008), without yellow, on white."""

WALL_COLOUR = "#9a9a9a"
LIVE_LINE: dict[str, Any] = {"linewidth": 2.2}
PDR_LINE: dict[str, Any] = {"linewidth": 1.0, "alpha": 0.4}
TRUTH_LINE: dict[str, Any] = {"linewidth": 0.8, "linestyle": (0, (4, 2))}
LONGEST_SIDE_IN = 9.0
LEGEND_IN = 2.2
DOTS_PER_INCH = 130


def draw_tracks(evidence: Evidence, plan: Plan | None, path: Path) -> None:
    """Draw what ``evidence`` holds as a PNG at ``path``, which is replaced whole or not at all.

    For each responder: the truth thin and dashed, dead reckoning alone light, the post's estimates
    bold. DAPs: where they stand as squares, where they were held to stand as crosses, joined.
    The walls of ``plan``, of all floors, lie under them. Metres, the same scale both ways, north
    up. The folder of ``path`` must exist.
    """
    walls_m = np.empty((0, 2, 2)) if plan is None else plan.wall_pieces_m
    figure = Figure(figsize=_size_in(evidence, walls_m), dpi=DOTS_PER_INCH, layout="constrained")
    entries = draw_map(figure.add_subplot(), evidence, plan)
    if entries:
        figure.legend(handles=entries, loc="outside right upper", frameon=False, fontsize=9)
    save(figure, path)


def draw_map(axes: Axes, evidence: Evidence, plan: Plan | None) -> list[Line2D]:
    """Draw what ``draw_tracks`` draws into ``axes``; return what a legend is to show."""
    walls_m = np.empty((0, 2, 2)) if plan is None else plan.wall_pieces_m
    axes.add_collection(
        LineCollection(list(walls_m[..., ::-1]), colors=WALL_COLOUR, linewidths=1.0)
    )
    entries = _draw_responders(axes, evidence) + _draw_daps(axes, evidence)
    axes.set_aspect("equal")
    axes.margins(0.04)
    axes.autoscale_view()
    axes.set_xlabel("east (m)")
    axes.set_ylabel("north (m)")
    axes.grid(color="#e4e4e4", linewidth=0.5)
    axes.set_axisbelow(True)
    return entries


def save(figure: Figure, path: Path) -> None:
    """Write ``figure`` as a PNG at ``path``, which is replaced whole or not at all."""
    figure.set_canvas(FigureCanvasAgg(figure))
    with replace_atomically(path) as file:
        figure.savefig(file, format="png", bbox_inches="tight", pad_inches=0.15)


def _draw_responders(axes: Axes, evidence: Evidence) -> list[Line2D]:
    """Draw all tracks; return what the legend is to show."""
    pdr, live = evidence.tracks("pdr"), evidence.tracks("live")
    entries = []
    for name, colour in zip(evidence.responders(), cycle(COLOURS), strict=False):
        _draw(axes, pdr.get(name), PDR_LINE, colour)
        _draw(axes, live.get(name), LIVE_LINE, colour)
        _draw(axes, evidence.truth(name), TRUTH_LINE, "black")
        entries.append(Line2D([], [], color=colour, **LIVE_LINE, label=name))
    if entries:
        entries += [
            Line2D([], [], color="grey", **LIVE_LINE, label="tracked live"),
            Line2D([], [], color="grey", **PDR_LINE, label="dead reckoning alone"),
            Line2D([], [], color="black", **TRUTH_LINE, label="truth"),
        ]
    return entries


def _draw(axes: Axes, track: Track | None, line: Mapping[str, Any], colour: str) -> None:
    if track is not None:
        axes.plot(track.position_m[:, 1], track.position_m[:, 0], color=colour, **line)


def _draw_daps(axes: Axes, evidence: Evidence) -> list[Line2D]:
    """Draw all DAPs; return what the legend is to show."""
    truths, estimates = evidence.dap_truths_m(), evidence.dap_estimates_m()
    for name in sorted(truths | estimates):
        places = [there[name][:2] for there in (truths, estimates) if name in there]
        north, east = np.array(places).T
        axes.plot(east, north, color="black", linewidth=0.8)
        axes.annotate(name, (east[0], north[0]), (5, 5), textcoords="offset points", fontsize=8)
    entries = []
    for there, marker, label in ((truths, "s", "DAP"), (estimates, "x", "DAP, as estimated")):
        if there:
            north, east = np.array([place[:2] for place in there.values()]).T
            entries += axes.plot(
                east, north, marker, color="black", markersize=7, fillstyle="none", label=label
            )
    return entries


def _size_in(evidence: Evidence, walls_m: Floats) -> tuple[float, float]:
    """Return a figure size whose longer side is ``LONGEST_SIDE_IN``, in the scene's proportions."""
    tracks = [*evidence.tracks("pdr").values(), *evidence.tracks("live").values()]
    places = [track.position_m[:, :2] for track in tracks]
    together = np.concatenate([*places, walls_m.reshape(-1, 2)])
    north_m, east_m = np.ptp(together, axis=0) if together.size else (1.0, 1.0)
    width, height = max(east_m, 0.4 * north_m, 1.0), max(north_m, 0.4 * east_m, 1.0)
    scale = LONGEST_SIDE_IN / max(width, height)
    return width * scale + LEGEND_IN, height * scale
