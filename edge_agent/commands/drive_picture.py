"""A picture of a drive: speed beside the car's own, acceleration beside a fixed phone's."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from edge_agent.commands.track_picture import DOTS_PER_INCH, ERROR_COLOUR, TRACK_COLOUR
from edge_agent.evaluation.course_truth import MountedDrive
from edge_agent.evaluation.vehicle_score import Drive
from shared.files import replace_atomically
from shared.units import NS_PER_S

SIZE_IN = (9.0, 7.0)


def draw_drive(
    drive: Drive, fixed: Drive | None, truth: MountedDrive, title: str, file: Path
) -> None:
    """Draw ``drive`` as a PNG at ``file``, which is replaced whole or not at all.

    Above, the speed of the moment, bold, and the car's own, dashed. Below, where there were slips,
    forward acceleration and what it is off from the ``fixed`` phone's. Slips are shaded, a sudden
    one is a line. The folder of ``file`` must exist.
    """
    begin_s = int(truth.fixed.samples.time_ns[0]) / NS_PER_S
    time_s = truth.fixed.samples.time_ns / NS_PER_S - begin_s
    figure = Figure(figsize=SIZE_IN, dpi=DOTS_PER_INCH, layout="constrained")
    rows = figure.subplots(2 if fixed is not None else 1, 1, sharex=True, squeeze=False)[:, 0]
    speed = truth.fixed.speed
    rows[0].plot(time_s, drive.speed_m_s, color=TRACK_COLOUR, linewidth=2.2, label="told")
    true_m_s = np.interp(time_s + begin_s, speed.time_s, speed.speed_m_s)
    rows[0].plot(time_s, true_m_s, "--", color="black", linewidth=0.8, label="the car's own")
    rows[0].set_ylabel("speed (m/s)")
    if fixed is not None:
        forward_m_s2 = drive.acceleration_m_s2[:, 0]
        off_m_s2 = forward_m_s2 - fixed.acceleration_m_s2[:, 0]
        rows[1].plot(time_s, forward_m_s2, color=TRACK_COLOUR, linewidth=0.5, label="forward")
        rows[1].plot(time_s, off_m_s2, color=ERROR_COLOUR, linewidth=0.8, label="off the fixed")
        rows[1].set_ylabel("acceleration (m/s²)")
        rows[1].set_ylim(-6.0, 6.0)
    for axes in rows:
        _finish(axes, truth, begin_s)
    rows[-1].set_xlabel("time (s)")
    figure.suptitle(title)
    figure.set_canvas(FigureCanvasAgg(figure))
    with replace_atomically(file) as stream:
        figure.savefig(stream, format="png")


def _finish(axes: Axes, truth: MountedDrive, begin_s: float) -> None:
    for slip in truth.slips:
        axes.axvspan(slip.begin_s - begin_s, slip.end_s - begin_s, color="#cccccc", linewidth=1.0)
    axes.grid(color="#e4e4e4", linewidth=0.5)
    axes.legend(frameon=False)
