"""The cloud beside peers' particle filters: same walk, same models, same run.

The peers are an optional extra, ``peers``, never a dependency: filterpy's systematic resampling in
the loop that its users write around it, particles' SMC, and Stone Soup's predictor and updater,
which is spared the scattering of drift and scale that the others do when they resample. All have
1024 particles, five Student-t likelihoods a stride, resampling below half of them as effective
count, and moments after each stride. Timed is filtering alone, best of twenty: the walk is laid
out as each takes it before. Runs with ``--benchmark-enable``; a table ends it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from datetime import datetime, timedelta
from typing import Any, NamedTuple

import numpy as np
import pytest
from pytest_benchmark.fixture import BenchmarkFixture
from rich.console import Console
from rich.table import Table

from command_post.fusion.cloud.chance import Key
from command_post.fusion.cloud.cloud import Moments, packed, run, spawn, told_by
from tests.benchmarks.particle_world import (
    MODEL,
    PARTICLES,
    START,
    STRIDES,
    Floats,
    Told,
    log_likelihood,
    loosened,
    moved,
    started,
    steps,
    strides,
    summed_up,
    truth_m,
)

ROUNDS = 20
LEAST_STEPS_PER_S = 120_000
LEAST_RATIO = 30.0
MISSING = "not installed: pip install 'clew[peers]'"

Filter = Callable[[], Any]
"""Filters the whole walk; returns the moments after each stride, as each has them."""


class Method(NamedTuple):
    """``follow`` is what is timed, ``told`` reads what it returns."""

    follow: Filter
    told: Callable[[Any], Sequence[Moments | Told]] = list


def cloud() -> Method:
    start = spawn(START, PARTICLES, Key(1, 1))
    laid_out = packed(start, steps(), MODEL)
    return Method(
        lambda: run(start, laid_out)[1], lambda summaries: told_by(summaries, start.origin_m)
    )


def filterpy() -> Method:
    peer = pytest.importorskip("filterpy.monte_carlo", reason=MISSING)
    told = strides()

    def follow() -> list[Told]:
        rng = np.random.default_rng(1)
        state, weights = started(rng), np.full(PARTICLES, 1.0 / PARTICLES)
        found = []
        for one in told:
            state = moved(state, one, rng)
            log_weights = log_likelihood(state, one)
            weights *= np.exp(log_weights - log_weights.max())
            weights /= weights.sum()
            found.append(summed_up(state, weights))
            if 1.0 / (weights @ weights) < MODEL.resample_below * PARTICLES:
                state = loosened(state[:, peer.systematic_resample(weights)], rng)
                weights.fill(1.0 / PARTICLES)
        return found

    return Method(follow)


def particles() -> Method:
    peer = pytest.importorskip("particles", reason=MISSING)
    told = strides()

    class Walk(peer.FeynmanKac):  # type: ignore[misc, name-defined]
        """The walk; a state of theirs is one row."""

        smc: Any

        def __init__(self) -> None:
            super().__init__(T=STRIDES)
            self.rng = np.random.default_rng(1)

        def M0(self, N: int) -> Floats:  # noqa: N802, N803
            assert N == PARTICLES
            return moved(started(self.rng), told[0], self.rng).T

        def M(self, t: int, xp: Floats) -> Floats:  # noqa: N802
            drawn = loosened(xp.T, self.rng) if self.smc.rs_flag else xp.T
            return moved(drawn, told[t], self.rng).T

        def logG(self, t: int, _: Floats | None, x: Floats) -> Floats:  # noqa: N802
            return log_likelihood(x.T, told[t])

    def follow() -> list[Told]:
        walk = Walk()
        walk.smc = smc = peer.SMC(walk, PARTICLES, ESSrmin=MODEL.resample_below, collect="off")
        return [summed_up(smc.X.T, smc.W) for _ in smc]

    return Method(follow)


def stone_soup() -> Method:
    transition = pytest.importorskip("stonesoup.models.transition", reason=MISSING)
    measurement = pytest.importorskip("stonesoup.models.measurement")
    types = pytest.importorskip("stonesoup.types")
    predictors = pytest.importorskip("stonesoup.predictor.particle")
    updaters = pytest.importorskip("stonesoup.updater.particle")
    resamplers = pytest.importorskip("stonesoup.resampler.particle")
    for module in ("state", "detection", "hypothesis"):
        pytest.importorskip(f"stonesoup.types.{module}")
    told = strides()
    stride_s, began = timedelta(seconds=1), datetime(2026, 1, 1)  # noqa: DTZ001 - as Stone Soup has it

    def number(at: datetime) -> int:
        return (at - began) // stride_s - 1

    class Walk(transition.TransitionModel):  # type: ignore[misc, name-defined]
        """The walk's transitions; the stride is told by the time."""

        ndim_state = 5
        pdf = rvs = None

        def function(self, state: Any, **_: Any) -> Any:
            one = told[number(state.timestamp + stride_s)]
            return types.array.StateVectors(moved(np.asarray(state.state_vector), one, self.rng))

    class Nearness(measurement.MeasurementModel):  # type: ignore[misc, name-defined]
        """All five DAPs at once."""

        ndim_state, ndim_meas, mapping = 5, 5, (0, 1)
        function = pdf = rvs = None

        def logpdf(self, detection: Any, state: Any, **_: Any) -> Floats:
            one = told[number(detection.timestamp)]
            return log_likelihood(np.asarray(state.state_vector), one)

    def follow() -> list[Told]:
        walk = Walk()
        walk.rng = np.random.default_rng(1)
        predictor = predictors.ParticlePredictor(walk)
        resampler = resamplers.ESSResampler(MODEL.resample_below * PARTICLES)
        updater = updaters.ParticleUpdater(Nearness(), resampler)
        state = types.state.ParticleState(
            types.array.StateVectors(started(walk.rng)),
            log_weight=np.full(PARTICLES, -np.log(PARTICLES)),
            timestamp=began,
        )
        found = []
        for n in range(STRIDES):
            at = began + (n + 1) * stride_s
            predicted = predictor.predict(state, timestamp=at)
            detection = types.detection.Detection(told[n].daps_m.reshape(-1, 1), timestamp=at)
            state = updater.update(types.hypothesis.SingleHypothesis(predicted, detection))
            found.append(summed_up(np.asarray(state.state_vector), np.exp(state.log_weight)))
        return found

    return Method(follow)


FILTERS: dict[str, Callable[[], Method]] = {
    "clew": cloud,
    "filterpy": filterpy,
    "particles": particles,
    "Stone Soup": stone_soup,
}


@pytest.fixture(scope="module")
def side_by_side(request: pytest.FixtureRequest) -> Iterator[dict[str, float]]:
    """Strides a second of each filter; printed as a table when all have run."""
    reached: dict[str, float] = {}
    yield reached
    capture = request.config.pluginmanager.getplugin("capturemanager")
    if reached and capture is not None:
        with capture.global_and_fixture_disabled():
            Console().print("", _table(reached))


@pytest.mark.parametrize("name", FILTERS)
def test_walk(name: str, benchmark: BenchmarkFixture, side_by_side: dict[str, float]) -> None:
    if benchmark.disabled:
        pytest.skip("seconds of peers: run with --benchmark-enable")
    method = FILTERS[name]()
    found = benchmark.pedantic(  # type: ignore[no-untyped-call]
        method.follow, rounds=ROUNDS, warmup_rounds=1
    )
    assert benchmark.stats is not None
    side_by_side[name] = STRIDES / benchmark.stats.stats.min
    benchmark.extra_info["strides_per_s"] = round(side_by_side[name])
    places = [(one.north_m, one.east_m) for one in method.told(found)]
    off_m = np.hypot(*(np.array(places) - truth_m()[1:]).T)
    assert np.median(off_m) < 0.5


def test_the_cloud_is_ahead(benchmark: BenchmarkFixture, side_by_side: dict[str, float]) -> None:
    if benchmark.disabled:
        pytest.skip("compares what the benchmarks measured: run with --benchmark-enable")
    own, peers = side_by_side["clew"], [v for k, v in side_by_side.items() if k != "clew"]
    if not peers:
        pytest.skip("no peer is " + MISSING)
    benchmark.pedantic(lambda: None)  # type: ignore[no-untyped-call]
    assert own >= LEAST_STEPS_PER_S
    assert own >= LEAST_RATIO * max(peers)


def _table(reached: dict[str, float]) -> Table:
    title = f"{PARTICLES} particles, five likelihoods a stride, one core"
    table = Table(title=title, title_justify="left")
    table.add_column("filter")
    table.add_column("strides/s", justify="right")
    table.add_column("clew is faster by", justify="right")
    for name, strides_per_s in reached.items():
        ratio = f"{reached['clew'] / strides_per_s:.0f}×" if "clew" in reached else ""
        table.add_row(name, f"{strides_per_s:,.0f}", ratio)
    return table
