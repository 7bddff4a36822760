"""Nearness and peaks on a real radio: a beacon carried past twelve receivers.

Readings come at about 1.9 Hz a receiver, on changing Bluetooth channels, and from a weaker
transmitter than a responder's: window and calibration are set for that, and the claim is modest.
"""

from __future__ import annotations

from pathlib import Path

import msgspec
import numpy as np
import pytest

from dap_node.evaluation import LinkTrial, score
from dap_node.peak_score import score_peaks
from dap_node.proximity import ProximitySettings
from dap_node.settings import DapSettings
from dap_node.true_range import PASS_M
from dap_node.walk_by import try_receivers
from shared.rssi_peaks import PeakSettings
from shared.walk_by import WalkBy, calibration_db, path_loss, read_walk_by

BEACON = DapSettings(
    proximity=ProximitySettings(
        window_s=2.5, least_samples=3, enter_dbm=-41.0, leave_dbm=-44.0, silence_s=5.0
    ),
    peaks=PeakSettings(window_s=2.5, middle_s=2.5, silence_s=5.0),
)


@pytest.fixture(scope="module")
def recordings(data_dir: Path) -> list[WalkBy]:
    paths = sorted((data_dir / "rssi_walkby").glob("*.npz"))
    if not paths:
        pytest.skip(f"no rssi_walkby in {data_dir}")
    return [read_walk_by(path) for path in paths]


@pytest.fixture(scope="module")
def trials(recordings: list[WalkBy]) -> list[LinkTrial]:
    settings = msgspec.structs.replace(BEACON, offset_db=calibration_db(recordings))
    return [trial for one in recordings for trial in try_receivers(one, settings, PASS_M)]


def test_near_is_nearer_than_chance_by_far(
    recordings: list[WalkBy], trials: list[LinkTrial]
) -> None:
    told = score(trials)
    everywhere_m = np.concatenate(
        [np.hypot(*(one.beacon_m - one.receiver_m[one.receiver])[:, :2].T) for one in recordings]
    )
    assert told.events > 30
    assert told.p50_m < 2.5
    assert 1.0 - told.beyond_3_m > 0.6
    assert 1.0 - told.beyond_3_m > 5.0 * np.mean(everywhere_m < 3.0)


def test_the_louder_the_peak_the_nearer(trials: list[LinkTrial]) -> None:
    told = score_peaks(trial.peaks for trial in trials)
    sigma_m = {one.from_dbm: one.sigma_m for one in told.bins}
    assert sigma_m[-40] < 2.0
    assert sigma_m[-40] < sigma_m[-44] < sigma_m[-48] < sigma_m[-52]


def test_this_hall_hardly_weakens_a_radio(recordings: list[WalkBy]) -> None:
    """Which is why a peak says less there than in the simulator's buildings."""
    fit = path_loss(recordings)
    assert 1.2 < fit.exponent < 1.6
    assert 5.0 < fit.spread_db < 7.0
