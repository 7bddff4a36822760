"""A recording compared: with itself it is the same, smoothed it is not, and what fails says why."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from command_post.review.background import Background
from command_post.review.comparison import compare
from command_post.review.wishes import Sources, Wish
from shared.config import ConfigError
from shared.mcap_reader import read_recording
from tests.conftest import CHECKOUT
from tests.waiting import wait_for

CORRIDOR = CHECKOUT / "recordings" / "corridor.mcap"


def test_fused_as_it_was_nothing_is_apart() -> None:
    seen_ns: list[int] = []
    found = compare(Sources(CORRIDOR), Wish("team"), seen_ns.append)
    assert sorted(found.lines) == ["r1", "r2"]
    assert [each.most_m for each in found.differences.values()] == [0.0, 0.0]
    assert seen_ns == [each.log_time_ns for each in read_recording(CORRIDOR)]


def test_smoothed_ways_differ_by_what_is_told() -> None:
    found = compare(Sources(CORRIDOR), Wish("smoothed"))
    line, apart = found.lines["r1"], found.differences["r1"]
    assert len(line.times_s) == len(line.places_m) > 5
    assert np.all(np.diff(line.times_s) > 0.0)
    assert 0.0 < apart.median_m <= apart.p95_m <= apart.most_m < 5.0


def test_a_plan_that_cannot_be_used_is_named(tmp_path: Path) -> None:
    plan = tmp_path / "plan.geojson"
    plan.write_text("{}")
    with pytest.raises(ConfigError, match=r"plan\.geojson"):
        compare(Sources(CORRIDOR, plan=plan), Wish("team", plan=True))


def test_a_wish_that_fails_says_why_and_the_next_is_heard(tmp_path: Path) -> None:
    with Background(Sources(tmp_path / "gone.mcap"), 0, 1) as background:
        background.begin(Wish("published"))
        background.begin(Wish("team"))
        wait_for(lambda: background.progress.is_done, "the comparison to fail")
        wish, _, failed, _ = background.progress
    assert wish == Wish("team")
    assert failed is not None
    assert "gone.mcap" in failed
    assert background.result is None
