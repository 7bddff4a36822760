"""The picture: drawn from anything, whole or not at all."""

from __future__ import annotations

from pathlib import Path

import matplotlib.image
import numpy as np
import pytest

from command_post.evaluation.errors import measure
from command_post.evaluation.evidence import Evidence
from command_post.rehearsing.distribution_picture import Drawn, draw_monte_carlo
from command_post.rehearsing.picture import COLOURS, draw_tracks
from shared.simulation.plan import load_plan
from tests.stride_world import exercise
from tests.unit.test_fusion_scenario import evidence_of, fuse


def colours_of(path: Path) -> set[str]:
    """Return the colours of a picture's pixels as they are written in web pages, upper case."""
    pixels = np.rint(matplotlib.image.imread(path)[..., :3] * 255).astype(np.int32)
    return {f"#{colour:06X}" for colour in np.unique(pixels @ np.array([65536, 256, 1]))}


def test_tracks_are_drawn_over_the_building(tmp_path: Path) -> None:
    evidence = evidence_of(exercise(1), [])
    draw_tracks(evidence, load_plan("house_of_four_daps"), tmp_path / "tracks.png")
    assert set(COLOURS[:3]) <= colours_of(tmp_path / "tracks.png")
    assert COLOURS[4] not in colours_of(tmp_path / "tracks.png")


def test_nothing_is_drawn_as_an_empty_picture(tmp_path: Path) -> None:
    draw_tracks(Evidence(), None, tmp_path / "empty.png")
    assert not set(COLOURS) & colours_of(tmp_path / "empty.png")


def test_a_failed_drawing_leaves_the_old_picture(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "tracks.png"
    path.write_bytes(b"old")

    def fail(*_: object, **__: object) -> None:
        raise OSError("disk full")

    monkeypatch.setattr("matplotlib.figure.Figure.savefig", fail)
    with pytest.raises(OSError, match="disk full"):
        draw_tracks(Evidence(), None, path)
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


def test_errors_are_drawn_beside_the_tracks_of_a_run(tmp_path: Path) -> None:
    evidence = evidence_of(heard := exercise(1), fuse(heard))
    drawn = Drawn("world", [measure(evidence)], evidence, load_plan("house_of_four_daps"))
    draw_monte_carlo([drawn, drawn._replace(runs=[])], tmp_path / "errors.png")
    assert set(COLOURS[:3]) <= colours_of(tmp_path / "errors.png")
    height, width, _ = matplotlib.image.imread(tmp_path / "errors.png").shape
    assert height > 0.5 * width
