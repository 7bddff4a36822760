"""Many rehearsals of one scenario, each with its own chance, scored together."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path

import msgspec

from command_post.evaluation import RunErrors, measure
from command_post.incident import IncidentSettings
from command_post.rehearsal import Agents, evidence_of, rehearse_nodes

SEEDS_A_CHUNK = 5
"""The nodes' programs start once for this many runs."""


def run_many(
    scenario_name: str,
    runs: int,
    first_seed: int,
    settings: IncidentSettings,
    method: str | None,
    workers: int,
) -> Iterator[list[RunErrors]]:
    """Yield the errors of ``runs`` rehearsals chunk by chunk, in the order of their seeds.

    Run ``i`` has the seed ``first_seed + i``, for the world and for the fusion. ``workers``
    processes share the work, and nothing of the result depends on how many. Raises
    ``RehearsalError``.
    """
    starts = range(first_seed, first_seed + runs, SEEDS_A_CHUNK)
    end = first_seed + runs
    chunk = partial(_run_chunk, scenario_name, settings, Agents(method, imu=False))
    with ProcessPoolExecutor(workers) as pool:
        yield from pool.map(chunk, starts, [min(SEEDS_A_CHUNK, end - start) for start in starts])


def _run_chunk(
    scenario_name: str, settings: IncidentSettings, agents: Agents, first_seed: int, count: int
) -> list[RunErrors]:
    with tempfile.TemporaryDirectory(prefix="clew-montecarlo-") as folder:
        rehearse_nodes(scenario_name, first_seed, count, Path(folder), agents)
        return [
            measure(evidence_of(Path(folder) / str(seed), _seeded(settings, seed)))
            for seed in range(first_seed, first_seed + count)
        ]


def _seeded(settings: IncidentSettings, seed: int) -> IncidentSettings:
    fusion = msgspec.structs.replace(settings.fusion, seed=seed)
    return msgspec.structs.replace(settings, fusion=fusion)
