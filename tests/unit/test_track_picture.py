"""The picture of a trial: of any truth or none, whole or not at all."""

from __future__ import annotations

from pathlib import Path

import matplotlib.image
import numpy as np
import pytest

from edge_agent.commands.track_picture import ERROR_COLOUR, TRACK_COLOUR, draw_trial
from edge_agent.evaluation.estimate import EstimatedPath
from edge_agent.evaluation.truth import Truth, truth_of_stances
from tests.unit.test_picture import colours_of

TIME_S = np.arange(9.0)
PLACES_M = np.column_stack((1.2 * TIME_S, 0.1 * TIME_S**2, 0.0 * TIME_S))
TRUTH = truth_of_stances(TIME_S, 0.97 * PLACES_M[:, :2])


def path() -> EstimatedPath:
    return EstimatedPath(TIME_S, PLACES_M, np.empty((0, 2)))


def test_track_truth_and_stride_errors_are_drawn(tmp_path: Path) -> None:
    draw_trial(path(), TRUTH, "a trial", tmp_path / "trial.png")
    assert {TRACK_COLOUR.upper(), ERROR_COLOUR.upper(), "#000000"} <= colours_of(
        tmp_path / "trial.png"
    )


@pytest.mark.parametrize(
    "truth",
    [
        pytest.param(None, id="none"),
        pytest.param(Truth(TIME_S[:0], PLACES_M[:0, :2]), id="of no stance"),
        pytest.param(Truth(TIME_S[:1], PLACES_M[:1, :2]), id="of one stance"),
    ],
)
def test_without_truth_the_track_alone_is_drawn(truth: Truth | None, tmp_path: Path) -> None:
    draw_trial(path(), truth, "a trial", tmp_path / "trial.png")
    found = colours_of(tmp_path / "trial.png")
    assert TRACK_COLOUR.upper() in found
    assert ERROR_COLOUR.upper() not in found


def test_the_track_is_laid_onto_the_truth(tmp_path: Path) -> None:
    """A track turned and moved gives the very same picture."""
    turned = PLACES_M[:, [1, 0, 2]] * [-1.0, 1.0, 1.0] + 5.0
    draw_trial(path(), TRUTH, "a trial", tmp_path / "straight.png")
    draw_trial(
        EstimatedPath(TIME_S, turned, np.empty((0, 2))), TRUTH, "a trial", tmp_path / "turned.png"
    )
    straight, laid = (
        matplotlib.image.imread(tmp_path / name) for name in ("straight.png", "turned.png")
    )
    assert np.mean(np.abs(straight - laid) > 0.1) < 1e-3


def test_a_failed_drawing_leaves_the_old_picture(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "trial.png"
    file.write_bytes(b"old")

    def fail(*_: object, **__: object) -> None:
        raise OSError("disk full")

    monkeypatch.setattr("matplotlib.figure.Figure.savefig", fail)
    with pytest.raises(OSError, match="disk full"):
        draw_trial(path(), TRUTH, "a trial", file)
    assert file.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [file]
