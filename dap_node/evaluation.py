"""How near 'near' is: proximity events of simulated exercises against the truth (pure)."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from dap_node.proximity import Proximity, ProximityDetector, ProximitySettings
from dap_node.scanners.observation import Observation, Scan
from dap_node.scanners.simulated import SimulatedScanner
from shared.messages import NodeId
from shared.simulation.installation import installation_truth
from shared.simulation.scenario import Scenario
from shared.simulation.walker import simulate_walk
from shared.units import NS_PER_S

Array: TypeAlias = NDArray[np.float64]

PASS_M = 1.5
"""Who comes within this passes the DAP."""

PASS_MARGIN_S = 1.0
"""An event so long before or after a pass still belongs to it."""


class LinkTrial(NamedTuple):
    """One DAP and one responder in one exercise.

    Distances (m) from the floor underfoot to the DAP, at the times that events tell: ``entered_m``
    of those that begin a stay, ``near_m`` of those that go on with one. ``passes`` is how often
    the responder passed the DAP, ``noticed`` how many of these times there was an event.
    """

    entered_m: Array
    near_m: Array
    passes: int
    noticed: int


class ProximityScore(NamedTuple):
    """Trials together: distances (m) of entering, and of all events; NaN if there were none."""

    stays: int
    events: int
    entered_p50_m: float
    entered_p95_m: float
    p50_m: float
    p90_m: float
    p95_m: float
    beyond_3_m: float
    beyond_5_m: float
    passes: int
    noticed: int


def detect(observations: Iterable[Observation], settings: ProximitySettings) -> Iterator[Proximity]:
    """Yield what a detector tells of ``observations``."""
    detector = ProximityDetector(settings)
    for observation in observations:
        if isinstance(observation, Scan):
            for responder_id, rssi_dbm in observation.rssi_dbm.items():
                detector.add(observation.time_ns, responder_id, rssi_dbm)
            yield from detector.tick(observation.time_ns)


def try_dap(
    scenario: Scenario, dap_id: NodeId, seed: int, settings: ProximitySettings
) -> Iterator[LinkTrial]:
    """Yield how a DAP did with each responder in the exercise of ``seed``."""
    told: dict[NodeId, list[Proximity]] = defaultdict(list)
    for proximity in detect(SimulatedScanner(scenario, dap_id, seed).observations(0), settings):
        told[proximity.responder_id].append(proximity)
    installed_s, dap_m, _ = installation_truth(scenario, dap_id, seed)
    for responder_id in scenario.responders:
        body = simulate_walk(scenario, responder_id, seed).body
        distance_m = np.linalg.norm(body.position_m - dap_m, axis=1)
        time_s = {
            phase: np.array(
                [event.time_ns / NS_PER_S for event in told[responder_id] if event.phase == phase]
            )
            for phase in ("entered", "near")
        }
        stands = body.time_s >= installed_s
        passes = _passes(body.time_s[stands], distance_m[stands])
        event_s = np.concatenate(list(time_s.values()))
        yield LinkTrial(
            np.interp(time_s["entered"], body.time_s, distance_m),
            np.interp(time_s["near"], body.time_s, distance_m),
            len(passes),
            sum(_is_noticed(begin_s, end_s, event_s) for begin_s, end_s in passes),
        )


def score(trials: Iterable[LinkTrial]) -> ProximityScore:
    """Sum up ``trials`` (n ≥ 1)."""
    entered, near, passes, noticed = zip(*trials, strict=True)
    entered_m = np.concatenate(entered)
    all_m = np.concatenate([entered_m, *near])
    some_entered_m, some_m = (
        metres if len(metres) else np.array([np.nan]) for metres in (entered_m, all_m)
    )
    entered_p50_m, entered_p95_m = np.percentile(some_entered_m, (50.0, 95.0))
    p50_m, p90_m, p95_m = np.percentile(some_m, (50.0, 90.0, 95.0))
    return ProximityScore(
        stays=len(entered_m),
        events=len(all_m),
        entered_p50_m=float(entered_p50_m),
        entered_p95_m=float(entered_p95_m),
        p50_m=float(p50_m),
        p90_m=float(p90_m),
        p95_m=float(p95_m),
        beyond_3_m=float(np.mean(some_m > 3.0)),
        beyond_5_m=float(np.mean(some_m > 5.0)),
        passes=sum(passes),
        noticed=sum(noticed),
    )


def _passes(time_s: Array, distance_m: Array) -> list[tuple[float, float]]:
    """Return when each pass began and ended (s)."""
    close = np.concatenate([[False], distance_m < PASS_M, [False]])
    begins, ends = np.flatnonzero(close[1:] & ~close[:-1]), np.flatnonzero(close[:-1] & ~close[1:])
    return [(time_s[begin], time_s[end - 1]) for begin, end in zip(begins, ends, strict=True)]


def _is_noticed(begin_s: float, end_s: float, event_s: Array) -> bool:
    in_time = (event_s >= begin_s - PASS_MARGIN_S) & (event_s <= end_s + PASS_MARGIN_S)
    return bool(in_time.any())
