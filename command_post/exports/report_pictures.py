"""Pictures for a report: a map of each storey, and who was on which storey when."""

from __future__ import annotations

import base64
import io
from collections.abc import Sequence
from itertools import cycle

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from command_post.exports.material import Material, Stance
from command_post.rehearsing.picture import COLOURS
from shared.messages import NodeId
from shared.units import NS_PER_S

DOTS_PER_INCH = 130
WIDTH_IN = 8.0
MOST_LABELLED = 12
"""More than so many are told apart by nobody: then only alerts are named."""


def floor_map(material: Material, level: int) -> str:
    """Draw where everybody went on a storey, the DAPs there, and where alerts came."""
    figure = Figure(figsize=(WIDTH_IN, 0.72 * WIDTH_IN), dpi=DOTS_PER_INCH, layout="constrained")
    axes = figure.add_subplot()
    tracks = _live(material)
    for name, colour in _coloured(material).items():
        here = np.array(
            [
                each.place_m if material.level(each.floor_down_m) == level else (np.nan,) * 3
                for each in tracks[name]
            ]
        )
        label = name if len(tracks) <= MOST_LABELLED else None
        axes.plot(here[:, 1], here[:, 0], color=colour, linewidth=1.4, alpha=0.85, label=label)
    _draw_daps(axes, material, level)
    _draw_alerts(axes, material, level)
    axes.set_aspect("equal", adjustable="datalim")
    axes.margins(0.05)
    axes.set_xlabel("east (m)")
    axes.set_ylabel("north (m)")
    axes.grid(color="#e4e4e4", linewidth=0.5)
    if axes.get_legend_handles_labels()[0]:
        figure.legend(loc="outside right upper", frameon=False, fontsize=8)
    return _data_url(figure)


def floors_over_time(material: Material) -> str:
    """Draw on which storey everybody was held to be, a line each, and when alerts came."""
    tracks = _live(material)
    height_in = min(1.0 + 0.22 * len(tracks), 14.0)
    figure = Figure(figsize=(WIDTH_IN, height_in), dpi=DOTS_PER_INCH, layout="constrained")
    axes = figure.add_subplot()
    levels = [floor.level for floor in material.floors]
    shades = {level: COLOURS[number % len(COLOURS)] for number, level in enumerate(levels)}
    begin_ns = material.timeline.begin_ns
    for row, (name, stances) in enumerate(tracks.items()):
        for level, from_ns, to_ns in stays(material, stances):
            since_min, for_min = (from_ns - begin_ns) / 60e9, (to_ns - from_ns) / 60e9
            axes.broken_barh([(since_min, for_min)], (row - 0.35, 0.7), color=shades[level])
        for mark in material.timeline.marks:
            if mark.node_id == name:
                axes.plot(mark.at_s / 60.0, row, "v", color="black", markersize=6)
    axes.set_yticks(range(len(tracks)), list(tracks))
    axes.set_xlim(0.0, max(material.timeline.length_s / 60.0, 0.1))
    axes.invert_yaxis()
    axes.set_xlabel("minutes since the beginning")
    axes.grid(color="#e4e4e4", linewidth=0.5, axis="x")
    axes.set_axisbelow(True)
    for level in levels:
        axes.plot([], [], "s", color=shades[level], label=f"floor {level}")
    axes.plot([], [], "v", color="black", label="alert")
    figure.legend(loc="outside right upper", frameon=False, fontsize=8)
    return _data_url(figure)


def stays(material: Material, stances: Sequence[Stance]) -> list[tuple[int, int, int]]:
    """Return on which storey somebody was, from when to when (ns), in the order of time."""
    found: list[tuple[int, int, int]] = []
    for each in stances:
        level = material.level(each.floor_down_m)
        if found and found[-1][0] == level:
            found[-1] = (level, found[-1][1], each.time_ns)
        else:
            if found:
                found[-1] = (*found[-1][:2], each.time_ns)
            found.append((level, each.time_ns, each.time_ns))
    return found


def _live(material: Material) -> dict[NodeId, list[Stance]]:
    return {name: stances for (name, kind), stances in material.tracks.items() if kind == "live"}


def _coloured(material: Material) -> dict[NodeId, str]:
    return dict(zip(_live(material), cycle(COLOURS), strict=False))


def _draw_daps(axes: Axes, material: Material, level: int) -> None:
    for name, dap in material.daps.items():
        at = dap.position
        if material.level(at.down_m) == level:
            axes.plot(at.east_m, at.north_m, "s", color="black", markersize=7, fillstyle="none")
            axes.annotate(
                name, (at.east_m, at.north_m), (5, 5), textcoords="offset points", fontsize=7
            )


def _draw_alerts(axes: Axes, material: Material, level: int) -> None:
    for mark in material.timeline.marks:
        time_ns = material.timeline.begin_ns + round(mark.at_s * NS_PER_S)
        there = material.where(mark.node_id, time_ns)
        if there is None or material.level(there.floor_down_m) != level:
            continue
        north_m, east_m, _ = there.place_m
        axes.plot(east_m, north_m, "X", color="#b00020", markersize=9, markeredgecolor="white")
        axes.annotate(
            f"{mark.kind.replace('_', ' ')}: {mark.node_id}", (east_m, north_m), (7, -10),
            textcoords="offset points", fontsize=7, color="#b00020",
        )  # fmt: skip


def _data_url(figure: Figure) -> str:
    """Return a figure as a PNG that stands in a page itself."""
    FigureCanvasAgg(figure)
    content = io.BytesIO()
    figure.savefig(content, format="png", metadata={"Software": None})
    return f"data:image/png;base64,{base64.b64encode(content.getvalue()).decode()}"
