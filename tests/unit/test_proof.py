"""Proofs on recordings: what stands in for a boot, for a radio, and how a trial is scored."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from command_post.incident import IncidentSettings
from command_post.proof.boots import BootLog, boot_trial
from command_post.proof.radio import radio_trial, recordings_at
from command_post.proof.trial import RESPONDER, summed_up, trial_settings, try_out
from edge_agent.commands.retrace import retrace
from shared.bus.wire_log import read_wire_log
from shared.exercise import REHEARSAL_START_NS
from shared.messages import DapInstallation, Mount, OdometryIncrement, RssiPeak, TrackStart
from shared.process import ExitCode
from shared.simulation.chance import generator
from shared.simulation.retraced import walk_along
from shared.units import NS_PER_S
from shared.walk_by import WalkBy

START_S = REHEARSAL_START_NS / NS_PER_S


def to_and_fro(strides: int = 40) -> BootLog:
    """Return a faultless boot's log of a way out and back, its frame turned by half a right."""
    east_m = 1.3 * np.concatenate([np.arange(strides), np.arange(strides, -1, -1)])
    place_m = np.column_stack([np.zeros(len(east_m)), east_m])
    time_s = START_S + 3.0 + 1.2 * np.arange(len(east_m), dtype=np.float64)
    turned_m = place_m @ np.array([[1.0, 1.0], [-1.0, 1.0]]) / math.sqrt(2.0)
    said: list[TrackStart | OdometryIncrement] = [
        TrackStart(
            event_time_ns=round((time_s[0] - 1.0) * NS_PER_S), sequence=0, position=None,
            heading_sd_rad=3.0, mount="boot", method="eskf",
        )
    ]  # fmt: skip
    for k, (north_m, east_m_) in enumerate(np.diff(turned_m, axis=0).tolist()):
        said.append(
            OdometryIncrement(
                event_time_ns=round(time_s[k + 1] * NS_PER_S),
                sequence=k,
                start_time_ns=round((time_s[k + 1] - 0.6) * NS_PER_S),
                d_north_m=north_m,
                d_east_m=east_m_,
                d_down_m=0.0,
                d_heading_rad=0.0,
                heading_rad=0.0,
                covariance=(1e-4, 0.0, 0.0, 0.0, 1e-4, 0.0, 0.0, 1e-4, 0.0, 1e-6),
                mount="boot",
            )
        )
    return BootLog("to_and_fro", said, time_s, place_m)


def test_a_faultless_boot_is_put_right_by_daps_along_its_way() -> None:
    trial = boot_trial(to_and_fro(), 30.0, 30.0, seed=4)
    kinds = [type(heard.message) for heard in trial.heard]
    assert kinds.count(DapInstallation) == math.ceil(80 * 1.3 / 30.0)
    assert kinds.count(RssiPeak) >= 3
    assert np.hypot(*np.diff(trial.truth_m, axis=0).T) == pytest.approx(1.3)
    scored = summed_up([try_out(trial, trial_settings(IncidentSettings()))])
    assert scored.after is not None
    assert scored.live is not None
    assert scored.after.ce95_m < 1.5
    assert scored.after.ce50_m <= scored.live.ce95_m


def test_what_the_agent_knows_of_its_heading_is_true_of_the_trial() -> None:
    headings = []
    for seed in range(12):
        trial = boot_trial(to_and_fro(), 30.0, 10.0, seed)
        moves = [h.message for h in trial.heard if isinstance(h.message, OdometryIncrement)]
        own_rad = math.atan2(moves[0].d_east_m, moves[0].d_north_m)
        true_m = trial.truth_m[1] - trial.truth_m[0]
        headings.append(math.degrees(math.atan2(true_m[1], true_m[0]) - own_rad))
    assert 3.0 < np.std(headings) < 25.0
    assert abs(np.mean(headings)) < 10.0


def test_a_walk_along_a_known_way_comes_down_on_it() -> None:
    time_s = np.arange(0.0, 30.0, 0.25)
    # Stands for ten seconds in the middle.
    north_m = np.interp(time_s, [0.0, 10.0, 20.0, 30.0], [0.0, 10.0, 10.0, 20.0])
    way_m = np.column_stack([north_m, 0.5 * north_m, 0.0 * north_m])
    walk = walk_along(time_s, way_m, generator(1, "retraced"))
    place_m = np.array([fall.place_m for fall in walk.footfalls])
    assert place_m[:, 1] == pytest.approx(0.5 * place_m[:, 0])
    assert place_m[-1, 0] == pytest.approx(20.0, abs=1.5)
    assert (walk.left_s > walk.reached_s).all()
    assert (walk.reached_s[1:] > walk.left_s[:-1]).all()
    assert max(walk.left_s - walk.reached_s) > 9.0


def test_who_goes_slowly_along_a_known_way_leaves_no_time_for_strides_unseen() -> None:
    time_s = np.arange(0.0, 60.0, 0.25)
    way_m = np.column_stack([0.12 * time_s, 0.0 * time_s, 0.0 * time_s])
    walk = walk_along(time_s, way_m, generator(1, "retraced"))
    rests_s = walk.left_s - walk.reached_s
    assert np.diff([fall.place_m[0] for fall in walk.footfalls]) == pytest.approx(0.15, abs=0.01)
    assert np.ptp(rests_s[:-1]) < 0.05


def test_receivers_of_a_walk_pull_a_boot_that_heads_wrongly() -> None:
    time_s = np.repeat(np.arange(0.0, 40.0, 0.2), 2)
    receiver = np.tile([0, 1], len(time_s) // 2)
    receiver_m = np.array([[8.0, 0.5, 1.0], [30.0, 0.5, 1.0]])
    beacon_m = np.column_stack([time_s, 0.0 * time_s, np.ones_like(time_s)])
    range_m = np.linalg.norm(beacon_m - receiver_m[receiver], axis=1)
    rssi_dbm = -60.0 - 22.0 * np.log10(range_m)
    walk = WalkBy(time_s, receiver, rssi_dbm, receiver_m, beacon_m)
    trial = radio_trial("straight", walk, 20.0, 30.0, seed=2)
    peaks = [h for h in trial.heard if isinstance(h.message, RssiPeak)]
    assert {peak.node_id for peak in peaks} == {"dap1", "dap2"}
    scored = summed_up([try_out(trial, trial_settings(IncidentSettings()))])
    assert scored.after is not None
    assert scored.after.ce50_m < 1.5


def test_paths_without_recordings_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"no \.npz file"):
        recordings_at([str(tmp_path)])


def test_the_agent_retraces_a_recording_with_its_truth(data_dir: Path, tmp_path: Path) -> None:
    recording = data_dir / "foot_strides" / "mixed_48.npz"
    if not recording.is_file():
        pytest.skip("no foot_strides among the real recordings")
    assert retrace([str(recording)], output=tmp_path) == ExitCode.OK
    (log,) = tmp_path.glob("*.wire")
    keys = [frame.key for frame in read_wire_log(log)]
    assert sum(key.endswith(f"/{RESPONDER}/truth") for key in keys) == 9
    assert sum(key.endswith(f"/{RESPONDER}/increment") for key in keys) >= 7


@pytest.mark.parametrize(
    ("mount", "equal_steps", "tracks", "truths", "moves"),
    [("waist", True, 1, 34, 33), ("waist", False, 1, 35, 33), ("boot", False, 2, 35, 33)],
)
def test_the_agent_retraces_belts_and_feet_along_their_course(
    data_dir: Path, tmp_path: Path, mount: Mount, equal_steps: bool,
    tracks: int, truths: int, moves: int,
) -> None:  # fmt: skip
    recording = data_dir / "waist_20m" / "10-1.npz"
    if not recording.is_file():
        pytest.skip("no waist_20m among the real recordings")
    told = retrace([str(recording)], output=tmp_path, mount=mount, equal_steps=equal_steps)
    assert told == ExitCode.OK
    logs = list(tmp_path.glob("*.wire"))
    keys = [frame.key for log in logs for frame in read_wire_log(log)]
    assert len(logs) == tracks
    assert sum(key.endswith(f"/{RESPONDER}/truth") for key in keys) == truths
    assert sum(key.endswith(f"/{RESPONDER}/increment") for key in keys) == pytest.approx(
        moves, abs=3
    )
