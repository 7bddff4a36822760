"""Many rehearsals of one scenario, each with its own chance, scored together."""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
import tempfile
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path
from types import FrameType

import msgspec

from command_post.evaluation import RunErrors, measure
from command_post.incident import IncidentSettings
from command_post.rehearsal import Agents, evidence_of, rehearse_nodes
from shared.process import ExitCode, end_with_parent

SEEDS_A_CHUNK = 5
"""The nodes' programs start once for this many runs."""


def run_many(
    scenario_name: str,
    runs: int,
    first_seed: int,
    settings: IncidentSettings,
    agents: Agents,
    workers: int,
) -> Iterator[list[RunErrors]]:
    """Yield the errors of ``runs`` rehearsals chunk by chunk, in the order of their seeds.

    Run ``i`` has the seed ``first_seed + i``, for the world and for the fusion. ``workers``
    processes share the work, and nothing of the result depends on how many. Raises
    ``RehearsalError``.
    """
    starts = range(first_seed, first_seed + runs, SEEDS_A_CHUNK)
    end = first_seed + runs
    chunk = partial(_run_chunk, scenario_name, settings, agents)
    with ProcessPoolExecutor(workers, initializer=_heed_the_main_process_alone) as pool:
        try:
            counts = [min(SEEDS_A_CHUNK, end - start) for start in starts]
            yield from pool.map(chunk, starts, counts)
        except BaseException:
            for worker in multiprocessing.active_children():
                worker.terminate()
            raise


def _heed_the_main_process_alone() -> None:
    """Leave when the main process says so or is gone; Ctrl-C, which reaches all, is for it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, _leave)
    main = multiprocessing.parent_process()
    if main is not None:
        end_with_parent(main.sentinel)


def _leave(_number: int, _frame: FrameType | None) -> None:
    # The pool tells it to all who are left once one of them has gone.
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    sys.exit(ExitCode.INTERRUPTED)


def _run_chunk(
    scenario_name: str, settings: IncidentSettings, agents: Agents, first_seed: int, count: int
) -> list[RunErrors]:
    try:
        with tempfile.TemporaryDirectory(prefix="clew-montecarlo-") as folder:
            rehearse_nodes(scenario_name, first_seed, count, Path(folder), agents)
            return [
                measure(evidence_of(Path(folder) / str(seed), _seeded(settings, seed)))
                for seed in range(first_seed, first_seed + count)
            ]
    except SystemExit as told:
        # The pool would take it for what came of this chunk, and begin the next.
        os._exit(int(told.code or 0))


def _seeded(settings: IncidentSettings, seed: int) -> IncidentSettings:
    fusion = msgspec.structs.replace(settings.fusion, seed=seed)
    return msgspec.structs.replace(settings, fusion=fusion)
