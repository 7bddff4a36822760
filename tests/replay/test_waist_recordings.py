"""The waist's two methods on real recordings, and on the published way out and back."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from edge_agent.evaluation.score_card import TrialScore
from edge_agent.evaluation.step_places import StepsOff
from edge_agent.evaluation.waist_score import score_waist
from edge_agent.mounts.methods import MethodName, make_mount
from edge_agent.sources.feet_trials import trunk_between, whole_feet
from edge_agent.sources.trials import find_trials


def rows(where: object, method: MethodName, name: str = "") -> list[TrialScore]:
    scored = []
    for trial in find_trials(str(where), 0, "waist"):
        if name not in trial.name:
            continue
        mount = make_mount("waist", method)
        data = trial.load()
        told = mount.steps(data.samples) + mount.finish()
        scored.append(score_waist(trial.name, trial.group, told, data.truth))
    return scored


def magnitudes(scored: list[TrialScore], metric: str) -> np.ndarray:
    return np.abs([getattr(row, metric) for row in scored])


@pytest.fixture(scope="module")
def robust(data_dir: Path) -> list[TrialScore]:
    return rows(data_dir / "waist_20m", "robust")


def test_steps_of_nine_people_are_counted(robust: list[TrialScore]) -> None:
    off = magnitudes(robust, "steps_off")
    assert len(off) == 27
    assert np.mean(off == 0.0) >= 0.5
    assert np.mean(off <= 1.0) >= 0.8
    assert magnitudes(robust, "missed_stances_pct").mean() <= 6.0
    assert magnitudes(robust, "false_stances_pct").mean() <= 6.0


def test_steps_are_miscounted_at_the_ends_and_in_the_turn(robust: list[TrialScore]) -> None:
    places = [f"off_{place}" for place in StepsOff._fields]
    for row in robust:
        assert sum(getattr(row, place) for place in places) == row.steps_off
    assert np.mean(magnitudes(robust, "off_way") == 0.0) >= 0.9


def test_marks_are_as_the_feet_tell_where_no_sample_of_them_is_lost(
    robust: list[TrialScore],
) -> None:
    whole = [row for row in robust if row.steps_by_feet is not None]
    assert len(whole) == 14
    assert sum(row.steps_by_feet == row.steps_true for row in whole) == 12


def test_marks_contradict_themselves(robust: list[TrialScore]) -> None:
    """Who walks has never both feet in the air, nor flies twice on one foot without a rest."""
    assert sum(row.contradictions != 0 for row in robust) == 12


def test_twenty_metres_are_twenty_metres_of_people_nobody_tuned_to(
    robust: list[TrialScore],
) -> None:
    told_m = 20.0 + 0.2 * np.array([float(row.distance_error_pct or 0.0) for row in robust])
    assert np.median(np.abs(told_m - 20.0)) <= 0.03 * 20.0
    people = np.array([row.name.split("-")[0] for row in robust])
    scales = {one: np.median(20.0 / told_m[people == one]) for one in set(people)}
    left_out = np.empty_like(told_m)
    for person in scales:
        scale = np.median([scale for one, scale in scales.items() if one != person])
        assert scale == pytest.approx(1.0, abs=0.03)
        left_out[people == person] = scale * told_m[people == person]
    assert np.median(np.abs(left_out - 20.0)) <= 0.03 * 20.0


def test_the_way_closes(robust: list[TrialScore]) -> None:
    assert np.median(magnitudes(robust, "closure_2d_m")) <= 1.6


def test_as_published_the_mean_speed_is_filtered_away(data_dir: Path) -> None:
    published = rows(data_dir / "waist_20m", "published")
    assert 0.5 <= np.median(magnitudes(published, "distance_error_pct")) / 100.0 <= 0.8
    assert magnitudes(published, "steps_off").mean() <= 2.5


def test_out_and_back_every_step_is_counted() -> None:
    (row,) = rows("simulated:out_and_back", "robust", "r2")
    assert row.worst_m is not None
    assert row.worst_m <= 7.0
    assert row.steps_error_pct is not None
    assert abs(row.steps_error_pct) <= 1.0


def test_by_their_feet_people_turn_beyond_the_mark(data_dir: Path) -> None:
    """Ten metres of equal steps are not where they were, and both feet say so alike."""
    farthest_m, ends_m = [], []
    for path in sorted((data_dir / "waist_20m").glob("*.npz")):
        if whole_feet(path):
            along_m = trunk_between(path)[1].position_m[:, 0]
            farthest_m.append(along_m.max())
            ends_m.append(abs(along_m[-1]))
    assert len(farthest_m) == 14
    assert min(farthest_m) == pytest.approx(10.0, abs=0.05)
    assert np.median(farthest_m) == pytest.approx(10.4, abs=0.05)
    assert max(farthest_m) == pytest.approx(10.9, abs=0.05)
    assert max(ends_m) == pytest.approx(1.1, abs=0.05)
