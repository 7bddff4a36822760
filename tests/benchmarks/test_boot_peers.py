"""Our methods beside peers, on the same recordings in the same run: how good, and how fast.

The peers: gaitmap's zero-velocity RTS Kalman filter with its own defaults (an optional extra,
``peers``; never a dependency), and a SHOE baseline of our own. All are scored at the instants of
the true stances by the same functions. Timed is following alone: samples are laid out as each
method takes them before, scores are worked out after, and one recording is followed beforehand, so
that no compiler is timed. Runs with ``--benchmark-enable``; a table ends it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import Any, NamedTuple, get_args

import numpy as np
import pytest
from pytest_benchmark.fixture import BenchmarkFixture
from rich.console import Console
from rich.table import Table

from edge_agent.evaluation.errors import stance_errors
from edge_agent.evaluation.estimate import EstimatedPath, estimated_path
from edge_agent.evaluation.score_card import IN_PLACE, TrialScore, failed_trial, score_card, set_of
from edge_agent.evaluation.truth import Truth
from edge_agent.mounts.interface import Increment
from edge_agent.mounts.methods import MethodName, make_mount
from edge_agent.sources.recording import Recording
from edge_agent.sources.trials import find_trials
from shared.maths.statistics import Summary
from shared.messages import ImuSample
from shared.units import NS_PER_S
from tests.benchmarks.shoe_baseline import LEVELLING_S, shoe_path

FOLDERS = ("foot_strides", "foot_vicon")
TOLD = {
    "distance_error_pct": "distance %",
    "stride_rmse_m": "stride m",
    "end_error_pct": "end %",
    "missed_stances_pct": "missed %",
}
TABLE_WIDTH = 160


class Walked(NamedTuple):
    """A trial with truth that goes somewhere."""

    name: str
    group: str
    recording: Recording
    truth: Truth


class Method(NamedTuple):
    """``prepare`` lays a recording out, ``follow`` is what is timed, ``path`` reads its result."""

    prepare: Callable[[Recording], Any]
    follow: Callable[[Any], Any]
    path: Callable[[Any], EstimatedPath | None]


def ours(name: MethodName) -> Method:
    """One of our own, sample by sample as on the boot."""

    def follow(samples: list[ImuSample]) -> list[Increment]:
        mount = make_mount("boot", name)
        told = [found for sample in samples if (found := mount.step(sample)) is not None]
        return told + mount.finish()

    return Method(list, follow, lambda told: estimated_path(told) if told else None)


def shoe() -> Method:
    return Method(lambda recording: recording, shoe_path, lambda path: path)


def gaitmap() -> Method:
    """The peer as its users call it: whole recordings, degrees, levelled at the start, z up."""
    trajectory = pytest.importorskip(
        "gaitmap.trajectory_reconstruction",
        reason="gaitmap is not installed: pip install 'clew[peers]'",
    )
    rotations = pytest.importorskip("gaitmap.utils.rotations")
    pandas = pytest.importorskip("pandas")
    columns = [f"{sensor}_{axis}" for sensor in ("acc", "gyr") for axis in "xyz"]

    def prepare(recording: Recording) -> Any:
        readings = np.hstack((recording.force_m_s2, np.degrees(recording.rate_rad_s)))
        return recording.time_ns / NS_PER_S, pandas.DataFrame(readings, columns=columns)

    def follow(prepared: Any) -> Any:
        time_s, readings = prepared
        standing = time_s < time_s[0] + LEVELLING_S
        upwards = readings[columns[:3]].to_numpy()[standing].mean(axis=0)
        method = trajectory.RtsKalman(initial_orientation=rotations.get_gravity_rotation(upwards))
        rate_hz = 1.0 / float(np.median(np.diff(time_s)))
        return time_s, method.estimate(readings, sampling_rate_hz=rate_hz)

    def path(followed: Any) -> EstimatedPath:
        time_s, method = followed
        position_m = method.position_.to_numpy()[1:] * [1.0, -1.0, -1.0]
        stances = method.zupts_[["start", "end"]].to_numpy(dtype=np.intp)
        return EstimatedPath(time_s, position_m, time_s[np.minimum(stances, len(time_s) - 1)])

    return Method(prepare, follow, path)


METHODS: dict[str, Callable[[], Method]] = {
    **{name: partial(ours, name) for name in get_args(MethodName)},
    "gaitmap": gaitmap,
    "SHOE baseline": shoe,
}


@pytest.fixture(scope="module")
def walked(data_dir: Path) -> list[Walked]:
    """The trials of ``FOLDERS``, without those on the spot, which have no distance."""
    trials = [trial for folder in FOLDERS for trial in find_trials(str(data_dir / folder), 0)]
    found = []
    for trial in trials:
        data = trial.load()
        assert isinstance(data.truth, Truth)
        if not set_of(trial.group, data.truth).endswith(IN_PLACE):
            found.append(Walked(trial.name, trial.group, data.samples, data.truth))
    return found


@pytest.fixture(scope="module")
def side_by_side(request: pytest.FixtureRequest) -> Iterator[dict[str, dict[str, Any]]]:
    """What each method reached; printed as a table when all have run."""
    reached: dict[str, dict[str, Any]] = {}
    yield reached
    capture = request.config.pluginmanager.getplugin("capturemanager")
    if reached and capture is not None:
        with capture.global_and_fixture_disabled():
            Console(width=TABLE_WIDTH).print("", _table(reached))


@pytest.mark.parametrize("name", METHODS)
def test_all_trials(
    name: str,
    benchmark: BenchmarkFixture,
    request: pytest.FixtureRequest,
    side_by_side: dict[str, dict[str, Any]],
) -> None:
    if benchmark.disabled:
        pytest.skip("minutes of peers: run with --benchmark-enable")
    method = METHODS[name]()
    walked: list[Walked] = request.getfixturevalue("walked")
    prepared = [method.prepare(trial.recording) for trial in walked]
    method.follow(prepared[0])
    elapsed_s = 0.0

    def follow_all() -> list[Any]:
        nonlocal elapsed_s
        began_s = perf_counter()
        followed = [method.follow(one) for one in prepared]
        elapsed_s = perf_counter() - began_s
        return followed

    followed: list[Any] = benchmark.pedantic(follow_all, rounds=1)  # type: ignore[no-untyped-call]
    rows = [
        _row(trial, method.path(result)) for trial, result in zip(walked, followed, strict=True)
    ]
    samples = sum(len(trial.recording) for trial in walked)
    side_by_side[name] = {"samples_per_s": samples / elapsed_s, "medians": _medians(rows)}
    benchmark.extra_info.update(side_by_side[name])
    assert sum(row.failure is None for row in rows) > len(rows) // 2


def _row(trial: Walked, path: EstimatedPath | None) -> TrialScore:
    if path is None:
        return failed_trial(trial.name, trial.group, trial.truth, "no strides found")
    errors = stance_errors(path, trial.truth)._asdict()
    return TrialScore(name=trial.name, set=set_of(trial.group, trial.truth), **errors)


def _medians(rows: list[TrialScore]) -> dict[str, dict[str, float]]:
    """Return by set the median magnitude of each error of ``TOLD``, and how many trials failed."""
    medians: dict[str, dict[str, float]] = {}
    for name, summaries in score_card(rows).sets.items():
        medians[name] = {
            metric: summary.median
            for metric in TOLD
            if isinstance(summary := summaries.get(metric), Summary)
        }
        medians[name]["failed"] = float(isinstance(n := summaries["failed"], int) and n)
    return medians


def _table(reached: dict[str, dict[str, Any]]) -> Table:
    table = Table(title="Medians by set, side by side", title_justify="left")
    for heading in ("set", "method"):
        table.add_column(heading, no_wrap=True)
    for heading in (*TOLD.values(), "failed", "samples/s"):
        table.add_column(heading, justify="right")
    sets = sorted({name for one in reached.values() for name in one["medians"]})
    for name in sets:
        for method, one in reached.items():
            medians = one["medians"].get(name, {})
            told = [f"{medians[metric]:.2f}" if metric in medians else "" for metric in TOLD]
            failed = f"{medians.get('failed', 0.0):.0f}"
            table.add_row(name, method, *told, failed, f"{one['samples_per_s']:,.0f}")
        table.add_section()
    return table
