"""The chest's two methods on real recordings, and on the published loops."""

from __future__ import annotations

from pathlib import Path

import pytest

from edge_agent.evaluation.chest_score import score_chest
from edge_agent.evaluation.score_card import TrialScore, score_card
from edge_agent.mounts.methods import MethodName, make_mount
from edge_agent.sources.trials import Trial, find_trials
from shared.maths.statistics import Summary


def scored(trial: Trial, method: MethodName) -> TrialScore:
    mount = make_mount("chest", method)
    data = trial.load()
    told = mount.steps(data.samples) + mount.finish()
    return score_chest(trial.name, trial.group, told, data.truth)


def rows(where: object, method: MethodName, seed: int = 0) -> list[TrialScore]:
    return [scored(trial, method) for trial in find_trials(str(where), seed, "chest")]


def test_steps_without_a_gyroscope_are_counted_within_a_hundredth(data_dir: Path) -> None:
    (row,) = rows(data_dir / "chest_steps", "robust")
    assert row.steps_error_pct is not None
    assert abs(row.steps_error_pct) <= 1.0
    (published,) = rows(data_dir / "chest_steps", "published")
    assert published.steps_error_pct is not None
    assert abs(published.steps_error_pct) <= 2.0


def test_a_phone_in_the_hand_comes_by_the_way_points(data_dir: Path) -> None:
    found = {
        method: score_card(rows(data_dir / "phone_waypoints", method)).sets["phone_waypoints"]
        for method in ("robust", "published")
    }
    distance, ate = (found["robust"][what] for what in ("distance_error_pct", "ate_pct"))
    assert isinstance(distance, Summary)
    assert isinstance(ate, Summary)
    assert distance.median <= 5.0
    assert distance.p90 <= 8.0
    assert ate.median <= 2.5
    published = found["published"]["ate_pct"]
    assert isinstance(published, Summary)
    assert published.median > 2.0 * ate.median


@pytest.mark.parametrize("seed", [0])
def test_the_published_loops_close(seed: int) -> None:
    for row in rows("simulated:loops", "robust", seed):
        assert row.closure_2d_m is not None
        assert row.closure_2d_m <= 1.0
        assert row.steps_error_pct is not None
        assert abs(row.steps_error_pct) <= 1.0
