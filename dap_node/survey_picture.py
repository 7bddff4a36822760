"""A picture of signal strength and its variance against range, as the published figure 2 has it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from dap_node.measured import Measured
from dap_node.radio_survey import LEAST_IN_SPOT, NEAREST_M, Survey
from shared.files import replace_atomically

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
"""Colours that the colour-blind tell apart (Okabe and Ito 2008), without yellow, on white."""

SIZE_IN = (9.0, 8.0)
DOTS_PER_INCH = 130
MOST_DOTS = 4000
"""Of more readings a recording's dots are thinned: they would hide one another."""


def draw_survey(every: Sequence[tuple[Measured, Survey]], path: Path) -> None:
    """Draw recordings with what was made of them as a PNG at ``path``, replaced whole or not.

    Above, each reading's strength, the fitted path loss as a line; below, the variance of each
    place and receiver as dots, of each range bin the mean as a line. The folder must exist.
    """
    figure = Figure(figsize=SIZE_IN, dpi=DOTS_PER_INCH, layout="constrained")
    above, below = figure.subplots(2, 1, sharex=True)
    for number, (recording, survey) in enumerate(every):
        colour = COLOURS[number % len(COLOURS)]
        _draw_strength(above, recording, survey, colour)
        _draw_variance(below, recording, survey, colour)
    above.set_ylabel("RSSI, dBm")
    below.set_ylabel("variance at a place, dB²")
    below.set_yscale("symlog", linthresh=1.0)
    below.set_ylim(bottom=0.0)
    below.set_xlabel("range, m")
    for axes in (above, below):
        axes.grid(visible=True, alpha=0.3)
    figure.legend(loc="outside upper center", ncols=2, fontsize=8, frameon=False)
    figure.set_canvas(FigureCanvasAgg(figure))
    with replace_atomically(path) as file:
        figure.savefig(file, format="png")


def _draw_strength(axes: Axes, recording: Measured, survey: Survey, colour: str) -> None:
    readings, fit = recording.readings, survey.fit
    some = slice(None, None, -(-len(readings.rssi_dbm) // MOST_DOTS))
    axes.plot(
        readings.range_m[some], readings.rssi_dbm[some], ".", markersize=2, alpha=0.25, color=colour
    )
    range_m = np.geomspace(max(NEAREST_M, readings.range_m.min()), readings.range_m.max(), 100)
    fitted_dbm = fit.power_at_1_m_dbm - 10.0 * fit.exponent * np.log10(range_m)
    label = f"{recording.name}: exponent {fit.exponent:.2f}, σ {fit.sigma_db:.1f} dB"
    axes.plot(range_m, fitted_dbm, linewidth=2.0, color=colour, label=label)


def _draw_variance(axes: Axes, recording: Measured, survey: Survey, colour: str) -> None:
    readings = recording.readings
    _, spot, size = np.unique(readings.spot, return_inverse=True, return_counts=True)
    mean_dbm = np.bincount(spot, readings.rssi_dbm) / size
    square_db2 = np.bincount(spot, (readings.rssi_dbm - mean_dbm[spot]) ** 2)
    enough = size >= LEAST_IN_SPOT
    variance_db2 = square_db2[enough] / (size[enough] - 1)
    range_m = (np.bincount(spot, readings.range_m) / size)[enough]
    axes.plot(range_m, variance_db2, ".", markersize=3, alpha=0.35, color=colour)
    middle_m = [(one.from_m + one.to_m) / 2.0 for one in survey.bins]
    axes.plot(middle_m, [one.variance_db2 for one in survey.bins], linewidth=2.0, color=colour)
