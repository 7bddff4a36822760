"""A real drive, its phone as fixed and lying and slipping anyhow: what the mounts must reach."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from edge_agent.evaluation.degradation import jittered
from edge_agent.evaluation.score_card import TrialScore
from edge_agent.evaluation.vehicle_score import follow_drive, score_drive
from edge_agent.mounts.vehicle import VehicleMount
from edge_agent.mounts.vehicle_published import PublishedVehicleMount
from edge_agent.sources.vehicle_trials import lyings_of, mounted_drive


def score(
    path: Path, trial: str, new_mount: type[VehicleMount | PublishedVehicleMount]
) -> TrialScore:
    lying = next(one for one in lyings_of(path) if one.name.endswith(f"/{trial}"))
    samples, truth = mounted_drive(path, lying)
    speed = truth.fixed.speed
    drive = follow_drive(new_mount(), samples, speed)
    fixed = follow_drive(new_mount(), truth.fixed.samples, speed) if truth.slips else None
    return score_drive(trial, "vehicle", drive, fixed, truth)


@pytest.fixture
def recorded_drive(data_dir: Path) -> Path:
    return data_dir / "vehicle" / "comma2k19_60s.npz"


def test_speed_holds_for_a_minute_without_satellites(recorded_drive: Path) -> None:
    assert (score(recorded_drive, "piece_0", VehicleMount).speed_rmse_m_s or 9.0) <= 1.0


def test_half_the_rate_is_enough(recorded_drive: Path) -> None:
    lying = next(one for one in lyings_of(recorded_drive) if one.lie is None)
    samples, truth = mounted_drive(recorded_drive, lying)
    pairs = np.arange(0, len(samples) - 1, 2)
    even, odd = samples.rows(pairs), samples.rows(pairs + 1)
    halved = replace(
        odd,
        time_ns=(even.time_ns + odd.time_ns) // 2,
        force_m_s2=0.5 * (even.force_m_s2 + odd.force_m_s2),
        rate_rad_s=0.5 * (even.rate_rad_s + odd.rate_rad_s),
    )
    halved_truth = replace(truth, fixed=replace(truth.fixed, samples=halved))
    drive = follow_drive(VehicleMount(), halved, truth.fixed.speed)
    row = score_drive("halved", "vehicle", drive, None, halved_truth)
    assert (row.speed_rmse_m_s or 9.0) <= 1.0


def test_stamps_that_jitter_are_put_right(recorded_drive: Path) -> None:
    lying = next(one for one in lyings_of(recorded_drive) if one.lie is None)
    samples, truth = mounted_drive(recorded_drive, lying)
    worse = jittered(samples, np.random.default_rng(1), 0.005)
    drive = follow_drive(VehicleMount(), worse, truth.fixed.speed)
    row = score_drive("jitters", "vehicle", drive, None, truth)
    assert (row.speed_rmse_m_s or 9.0) <= 0.25


@pytest.mark.parametrize("seed", [0, 26, 32])
def test_slips_of_the_phone_change_nothing_that_is_told(recorded_drive: Path, seed: int) -> None:
    row = score(recorded_drive, f"seed_{seed}", VehicleMount)
    assert (row.speed_rmse_m_s or 9.0) <= 1.0
    assert (row.acceleration_rmse_m_s2 or 9.0) <= 0.2
    assert (row.acceleration_correlation or 0.0) >= 0.97
    assert row.realignment_s is not None
    assert row.realignment_s <= 0.2
    assert row.slips == 3


def test_the_published_method_is_worse_by_an_order_of_magnitude(recorded_drive: Path) -> None:
    ours, published = (
        score(recorded_drive, "piece_0", one) for one in (VehicleMount, PublishedVehicleMount)
    )
    assert (published.speed_rmse_m_s or 0.0) > 10.0 * (ours.speed_rmse_m_s or 9.0)
