"""A picture of a trial: the track beside the truth, and what each stride was off by."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from edge_agent.evaluation.course_truth import MountTruth, Waypoints
from edge_agent.evaluation.errors import align
from edge_agent.evaluation.estimate import EstimatedPath
from edge_agent.evaluation.truth import Array, Truth
from shared.files import replace_atomically

TRACK_COLOUR = "#0072B2"
ERROR_COLOUR = "#D55E00"
"""The colour-blind tell them apart (Okabe and Ito 2008)."""

SIZE_IN = (9.0, 9.0)
DOTS_PER_INCH = 130


def draw_trial(path: EstimatedPath, truth: MountTruth | None, title: str, file: Path) -> None:
    """Draw ``path`` as a PNG at ``file``, which is replaced whole or not at all.

    Above, the track in the plane, bold, with a dot at each true stance or way-point; where there
    are two or more, the track is rigidly aligned with them, and they lie over the track, dashed.
    Below, estimated minus true length of each stride, or of each leg of the way. Metres,
    the same scale both ways; north is up in the truth's frame, or the track's own. The folder of
    ``file`` must exist.
    """
    figure = Figure(figsize=SIZE_IN, dpi=DOTS_PER_INCH, layout="constrained")
    if not isinstance(truth, Truth | Waypoints) or len(truth.time_s) < 2:
        _draw_track(figure.add_subplot(), path, None)
    else:
        above, below = figure.subplots(2, 1, height_ratios=(3.0, 1.0))
        _draw_track(above, path, truth)
        _draw_length_errors(below, path, truth)
    figure.suptitle(title)
    figure.set_canvas(FigureCanvasAgg(figure))
    with replace_atomically(file) as stream:
        figure.savefig(stream, format="png")


def _draw_track(axes: Axes, path: EstimatedPath, truth: Truth | Waypoints | None) -> None:
    track_m = path.position_m[:, :2]
    if truth is not None:
        stood_m = path.at(truth.time_s)[:, :2]
        rotation, shift = align(stood_m, truth.position_m)
        track_m, stood_m = track_m @ rotation.T + shift, stood_m @ rotation.T + shift
        axes.plot(stood_m[:, 1], stood_m[:, 0], ".", color=TRACK_COLOUR)
    axes.plot(track_m[:, 1], track_m[:, 0], color=TRACK_COLOUR, linewidth=2.2, label="track")
    if truth is not None:
        axes.plot(
            truth.position_m[:, 1],
            truth.position_m[:, 0],
            ".--",
            color="black",
            linewidth=0.8,
            markersize=3.0,
            label="truth",
        )
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel("east (m)")
    axes.set_ylabel("north (m)")
    axes.grid(color="#e4e4e4", linewidth=0.5)
    axes.legend(frameon=False)


def _draw_length_errors(axes: Axes, path: EstimatedPath, truth: Truth | Waypoints) -> None:
    estimated_m = np.linalg.norm(np.diff(path.at(truth.time_s)[:, :2], axis=0), axis=1)
    error_cm = 100.0 * (estimated_m - _lengths_m(truth))
    axes.bar(np.arange(1, len(error_cm) + 1), error_cm, color=ERROR_COLOUR)
    axes.axhline(0.0, color="black", linewidth=0.8)
    axes.set_xlabel("stride" if isinstance(truth, Truth) else "leg of the way")
    axes.set_ylabel("length error (cm)")
    axes.grid(color="#e4e4e4", linewidth=0.5)
    axes.set_axisbelow(True)


def _lengths_m(truth: Truth | Waypoints) -> Array:
    """Return the true length (k - 1,) from each stance, or way-point, to the next."""
    lengths_m: Array = np.linalg.norm(np.diff(truth.position_m, axis=0), axis=1)
    return lengths_m
