"""Many rehearsals of one scenario, each with its own chance, to be scored together."""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
import tempfile
from collections import deque
from collections.abc import Iterator
from concurrent.futures import Executor, ProcessPoolExecutor
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from types import FrameType
from typing import NamedTuple, TypeAlias

import msgspec
import numpy as np
from numpy.typing import NDArray

from command_post.evaluation.errors import RunErrors, measure
from command_post.incident import IncidentSettings
from command_post.rehearsing.cluster import cluster
from command_post.rehearsing.rehearsal import Agents, Fused, fuse_logs, rehearse_nodes
from shared.process import ExitCode, end_with_parent
from shared.simulation.odometry_errors import OdometrySource
from shared.simulation.scenario import load_scenario

Floats: TypeAlias = NDArray[np.float64]

MOST_A_CHUNK: dict[OdometrySource, int] = {"imu": 5, "strides": 20}
"""The nodes' programs start once for so many runs at most: beside strides that is what costs."""
CHUNKS_A_WORKER = 2
CLUSTER_WORKERS = 16
"""A cluster is taken to be as large as this, for it may grow."""


class Exercise(NamedTuple):
    """What is rehearsed, but for its chance: a packaged scenario's name or a TOML file, and how."""

    scenario_name: str
    settings: IncidentSettings
    agents: Agents


class Run(NamedTuple):
    """What one rehearsal came to: its errors, and how long each message took to handle (ms).

    ``told_s`` as in ``Fused``.
    """

    errors: RunErrors
    handled_ms: Floats
    told_s: dict[tuple[str, str], float]


def run_many(
    exercise: Exercise, runs: int, first_seed: int, workers: int, address: str | None = None
) -> Iterator[list[Run]]:
    """Yield ``runs`` rehearsals chunk by chunk, in the order of their seeds.

    Run ``i`` has the seed ``first_seed + i``, for the world and for the fusion. ``workers``
    processes share the work, or the Dask cluster at ``address``, and nothing of the errors depends
    on who does. Raises ``RehearsalError``, and ``cluster.ClusterError``.
    """
    seeds = range(first_seed, first_seed + runs)
    share = runs // (CHUNKS_A_WORKER * (workers if address is None else CLUSTER_WORKERS))
    source = exercise.agents.odometry or load_scenario(exercise.scenario_name).odometry.source
    size = max(1, min(share, MOST_A_CHUNK[source]))
    chunks = [seeds[k : k + size] for k in range(0, runs, size)]
    if address is None:
        with _processes(min(workers, len(chunks))) as pool:
            # Work called off, as by map, would trip the pool's own thread once workers have gone.
            begun = deque(pool.submit(_run_or_leave, exercise, chunk) for chunk in chunks)
            while begun:
                yield begun.popleft().result()
    else:
        with cluster(address) as executor:
            yield from executor.map(partial(run_chunk, exercise), chunks)


def run_chunk(exercise: Exercise, seeds: range) -> list[Run]:
    """Return the runs of ``seeds``. Raises ``RehearsalError``."""
    plan = load_scenario(exercise.scenario_name).building
    floors_down_m = np.array([-floor.height_m for floor in plan.floors])
    told = []
    for fused in _fused(exercise, seeds):
        errors = measure(fused.evidence, floors_down_m)
        told.append(Run(errors, np.array(fused.handled_ms), fused.told_s))
    return told


def run_one(exercise: Exercise, seed: int) -> Fused:
    """Return all that there is of one run. Raises ``RehearsalError``."""
    return next(_fused(exercise, range(seed, seed + 1)))


def _fused(exercise: Exercise, seeds: range) -> Iterator[Fused]:
    with tempfile.TemporaryDirectory(prefix="clew-montecarlo-") as folder:
        rehearse_nodes(exercise.scenario_name, seeds, Path(folder), exercise.agents)
        for seed in seeds:
            yield fuse_logs(Path(folder) / str(seed), _seeded(exercise.settings, seed))


def _seeded(settings: IncidentSettings, seed: int) -> IncidentSettings:
    fusion = msgspec.structs.replace(settings.fusion, seed=seed)
    return msgspec.structs.replace(settings, fusion=fusion)


@contextmanager
def _processes(workers: int) -> Iterator[Executor]:
    """A pool of processes that end at once when this one gives up."""
    with ProcessPoolExecutor(workers, initializer=_heed_the_main_process_alone) as pool:
        try:
            yield pool
        except BaseException:
            for worker in multiprocessing.active_children():
                worker.terminate()
            raise


def _heed_the_main_process_alone() -> None:
    """Leave when the main process says so or is gone; Ctrl-C, which reaches all, is for it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    main = multiprocessing.parent_process()
    if main is not None:
        end_with_parent(main.sentinel)
    # Not before: the pool would tell at length of who left while this was being done.
    signal.signal(signal.SIGTERM, _leave)


def _leave(_number: int, _frame: FrameType | None) -> None:
    # The pool tells it to all who are left once one of them has gone.
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    sys.exit(ExitCode.INTERRUPTED)


def _run_or_leave(exercise: Exercise, seeds: range) -> list[Run]:
    try:
        return run_chunk(exercise, seeds)
    except SystemExit as told:
        # The pool would take it for what came of this chunk, and begin the next.
        os._exit(int(told.code or 0))
