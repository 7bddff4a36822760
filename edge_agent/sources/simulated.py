"""A source that walks a scenario: samples of a simulated sensor, and where it really is."""

from __future__ import annotations

import heapq
from collections.abc import Iterator

import numpy as np

from edge_agent.sources.reading import Reading, Source, TruePlace
from edge_agent.sources.recording import SourceError
from edge_agent.sources.simulated_cues import simulated_beacons, simulated_cues
from edge_agent.sources.simulated_wear import (
    refuse_unsimulated,
    simulate_worn,
    true_position_m,
)
from shared.messages import LocalPosition, Mount, NodeId
from shared.simulation.scenario import load_scenario
from shared.simulation.walker import simulate_walk
from shared.units import NS_PER_S

TRUTH_RATE_HZ = 10.0
START_SD_M = 0.5
"""How well somebody knows where at the entrance they stand."""


def open_simulated(
    scenario_name: str,
    responder_id: NodeId,
    seed: int,
    mount: Mount = "boot",
    *,
    hears_daps: bool = False,
) -> Source:
    """Return what the unit of ``responder_id`` reads in the exercise of ``seed``, and the truth.

    Raises ``SourceError`` if the scenario has no such responder or ``mount`` is not simulated,
    ``shared.config.ConfigError`` for a scenario that cannot be used.
    """
    refuse_unsimulated(mount)
    scenario = load_scenario(scenario_name)
    if responder_id not in scenario.responders:
        known = ", ".join(scenario.responders)
        raise SourceError(f"{scenario_name}: no responder {responder_id!r}; there are {known}")
    recording = simulate_worn(scenario, responder_id, seed, mount)
    walk = simulate_walk(scenario, responder_id, seed)
    begin_s, end_s = recording.time_s[[0, -1]]
    time_s = np.arange(begin_s, end_s, 1.0 / TRUTH_RATE_HZ)
    position_m = true_position_m(walk, mount, time_s)
    truth = [
        TruePlace(round(at_s * NS_PER_S), (north_m, east_m, down_m))
        for at_s, (north_m, east_m, down_m) in zip(
            time_s.tolist(), position_m.tolist(), strict=True
        )
    ]
    readings: Iterator[Reading] = heapq.merge(
        recording.samples(0),
        truth,
        simulated_cues(scenario, responder_id, seed),
        simulated_beacons(scenario, responder_id, seed) if hears_daps else (),
        key=lambda reading: reading.time_ns,
    )
    north_m, east_m, down_m, _ = scenario.start_of(responder_id)
    variance_m2 = START_SD_M**2
    start = LocalPosition(
        north_m=north_m,
        east_m=east_m,
        down_m=down_m,
        covariance_m2=(variance_m2, 0.0, variance_m2),
    )
    return Source(readings, 0, start)
