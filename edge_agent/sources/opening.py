"""Sources by their name on the command line: ``KIND:WHERE``."""

from __future__ import annotations

import heapq
from collections.abc import Iterable, Iterator
from itertools import chain
from pathlib import Path
from typing import NamedTuple, TypeAlias

import msgspec
import numpy as np

from edge_agent.sources.mcap_recording import read_imu_samples
from edge_agent.sources.npz_set import read_npz_set
from edge_agent.sources.recording import SourceError
from edge_agent.sources.simulated_cues import simulated_cues
from edge_agent.sources.vendor_csv import read_vendor_csv
from edge_agent.whereabouts import Cue
from shared.mcap_reader import RecordingError
from shared.messages import ImuSample, LocalPosition, NodeId
from shared.simulation.boot_imu import simulate_boot_imu
from shared.simulation.scenario import load_scenario
from shared.simulation.walker import simulate_walk
from shared.units import NS_PER_S

TRUTH_RATE_HZ = 10.0
START_SD_M = 0.5
"""How well somebody knows where at the entrance they stand."""


class TruePlace(NamedTuple):
    """Where the boot really is, which only a simulation knows: metres north, east, down."""

    time_ns: int
    position_m: tuple[float, float, float]


Reading: TypeAlias = ImuSample | Cue | TruePlace


class Source(NamedTuple):
    """Readings in the order of their time; ``begin_ns`` is the time they are counted from.

    ``start`` is where the wearer is known to stand at the beginning, ``None`` where the file
    does not say.
    """

    readings: Iterator[Reading]
    begin_ns: int
    start: LocalPosition | None

    def beginning_at(self, begin_ns: int) -> Iterator[Reading]:
        """Yield the readings with their times moved so that they begin at ``begin_ns``."""
        by_ns = begin_ns - self.begin_ns
        for reading in self.readings:
            if isinstance(reading, ImuSample):
                yield msgspec.structs.replace(reading, time_ns=reading.time_ns + by_ns)
            else:
                yield reading._replace(time_ns=reading.time_ns + by_ns)


def open_source(name: str, responder_id: NodeId, seed: int) -> Source:
    """Open ``csv:FILE``, ``npz:FILE``, ``mcap:FILE[#responder]`` or ``simulated:SCENARIO``.

    A simulated source has the samples of ``responder_id`` in the exercise of ``seed``, whom they
    hear, satellite fixes if there are any, and the truth. Raises ``SourceError`` if there is no
    such kind or the file cannot be used, and ``shared.config.ConfigError`` for a scenario that
    cannot be used.
    """
    kind, _, where = name.partition(":")
    if not where or kind not in ("csv", "npz", "mcap", "simulated"):
        raise SourceError(
            f"source {name!r}: use csv:FILE, npz:FILE, mcap:FILE[#responder] or simulated:SCENARIO"
        )
    if kind == "simulated":
        return _open_simulated(where, responder_id, seed)
    try:
        samples = iter(_samples(kind, where))
        first = next(samples, None)
    except RecordingError as error:
        raise SourceError(str(error)) from error
    if first is None:
        raise SourceError(f"{where}: no samples in it")
    return Source(chain((first,), samples), first.time_ns, None)


def _open_simulated(scenario_name: str, responder_id: NodeId, seed: int) -> Source:
    scenario = load_scenario(scenario_name)
    if responder_id not in scenario.responders:
        known = ", ".join(scenario.responders)
        raise SourceError(f"{scenario_name}: no responder {responder_id!r}; there are {known}")
    recording = simulate_boot_imu(scenario, responder_id, seed)
    foot = simulate_walk(scenario, responder_id, seed).foot
    begin_s, end_s = recording.time_s[[0, -1]]
    time_s = np.arange(begin_s, end_s, 1.0 / TRUTH_RATE_HZ)
    position_m, _ = foot.pose(time_s)
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


def _samples(kind: str, where: str) -> Iterable[ImuSample]:
    if kind == "csv":
        return read_vendor_csv(Path(where))
    if kind == "npz":
        return read_npz_set(Path(where)).recording
    path, _, responder_id = where.partition("#")
    return read_imu_samples(Path(path), responder_id or None)
