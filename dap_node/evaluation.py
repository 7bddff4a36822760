"""How near 'near' is: what a DAP tells of people who pass, against the truth (pure)."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple, Protocol, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

from dap_node.peak_score import PeakTrial, try_peaks
from dap_node.proximity import Proximity, ProximityDetector, ProximitySettings
from dap_node.scanners.observation import Observation, Scan, SetDown
from dap_node.scanners.simulated import SimulatedScanner
from dap_node.settings import DapSettings
from dap_node.true_range import TrueRange
from shared.messages import NodeId
from shared.rssi_peaks import PeakDetector
from shared.simulation.installation import installation_truth, is_set_down
from shared.simulation.scenario import Scenario
from shared.simulation.walker import simulate_walk
from shared.units import NS_PER_S

Array: TypeAlias = NDArray[np.float64]
Told_co = TypeVar("Told_co", covariant=True)
Told = TypeVar("Told")


class Detector(Protocol[Told_co]):
    """What both detectors can do."""

    def add(self, time_ns: int, station_id: NodeId, rssi_dbm: float, /) -> None:
        """Keep a reading."""

    def tick(self, now_ns: int, /) -> Sequence[Told_co]:
        """Return what there is to tell."""


class LinkTrial(NamedTuple):
    """One DAP and one responder, from the DAP's installation on.

    Ranges (m) at the times that events tell: ``entered_m`` of those that begin a stay, ``near_m``
    of those that go on with one. ``passes`` is how often the responder passed the DAP,
    ``noticed`` how many of these times there was an event.
    """

    entered_m: Array
    near_m: Array
    passes: int
    noticed: int
    peaks: PeakTrial


class ProximityScore(NamedTuple):
    """Trials together: ranges (m) at entering, and at all events; NaN if there were none."""

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


def try_dap(
    scenario: Scenario, dap_id: NodeId, seed: int, settings: DapSettings, pass_m: float
) -> list[LinkTrial]:
    """Return how a DAP did with each responder in the exercise of ``seed``.

    The range is from the floor underfoot to the DAP. Who comes within ``pass_m`` passes it. There
    is nothing to return of one that is never set down.
    """
    if not is_set_down(scenario, dap_id, seed):
        return []
    observations = list(SimulatedScanner(scenario, dap_id, seed).observations(0))
    installed_s, dap_m, _ = installation_truth(scenario, dap_id, seed)
    ranges = {}
    for responder_id in scenario.responders:
        body = simulate_walk(scenario, responder_id, seed).body
        stands = body.time_s >= installed_s
        # Who is done before the DAP stands never meets it.
        if stands.any():
            range_m = np.linalg.norm(body.position_m[stands] - dap_m, axis=1)
            ranges[responder_id] = TrueRange(body.time_s[stands], range_m)
    return try_links(observations, ranges, settings, pass_m)


def try_links(
    observations: Sequence[Observation],
    ranges: Mapping[NodeId, TrueRange],
    settings: DapSettings,
    pass_m: float,
) -> list[LinkTrial]:
    """Return how a DAP did with each of the responders whose true ``ranges`` are known.

    ``observations`` are in nanoseconds of the clock that ``ranges`` go by, readings as heard.
    """
    scans = list(to_scale(observations, settings))
    events = list(detect(scans, settings.proximity))
    peaks = PeakDetector(settings.peaks)
    told = [(scan.time_ns, peak) for scan in scans for peak in _hear(peaks, scan)]
    return [
        _trial(
            [event for event in events if event.responder_id == responder_id],
            true_range,
            pass_m,
            try_peaks(
                [(now_ns, peak) for now_ns, peak in told if peak.station_id == responder_id],
                true_range,
                pass_m,
            ),
        )
        for responder_id, true_range in ranges.items()
    ]


def _trial(
    events: list[Proximity], true_range: TrueRange, pass_m: float, peaks: PeakTrial
) -> LinkTrial:
    time_s = {
        phase: np.array([event.time_ns / NS_PER_S for event in events if event.phase == phase])
        for phase in ("entered", "near")
    }
    passes = true_range.passes(pass_m)
    event_s = np.concatenate(list(time_s.values()))
    return LinkTrial(
        true_range.at(time_s["entered"]),
        true_range.at(time_s["near"]),
        len(passes),
        sum(bool(one.holds(event_s).any()) for one in passes),
        peaks,
    )


def to_scale(observations: Iterable[Observation], settings: DapSettings) -> Iterator[Scan]:
    """Yield the scans on the product's scale: by models of radios, and as the DAP learns."""
    scale = settings.scale()
    for observation in observations:
        if isinstance(observation, SetDown):
            scale.set_down(observation.time_ns, observation.installer_id)
        elif isinstance(observation, Scan):
            time_ns = observation.time_ns
            calibrated_dbm = {
                responder_id: scale.calibrated_dbm(time_ns, responder_id, dbm)
                for responder_id, dbm in observation.rssi_dbm.items()
            }
            yield Scan(time_ns, calibrated_dbm)
            scale.tick(time_ns)


def detect(observations: Iterable[Observation], settings: ProximitySettings) -> Iterator[Proximity]:
    """Yield what a detector tells of ``observations``, whose readings are on its scale."""
    detector = ProximityDetector(settings)
    for observation in observations:
        if isinstance(observation, Scan):
            yield from _hear(detector, observation)


def score(trials: Iterable[LinkTrial]) -> ProximityScore:
    """Sum up the events of ``trials`` (n ≥ 1)."""
    entered, near, passes, noticed, _ = zip(*trials, strict=True)
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


def _hear(detector: Detector[Told], scan: Scan) -> Sequence[Told]:
    for responder_id, rssi_dbm in scan.rssi_dbm.items():
        detector.add(scan.time_ns, responder_id, rssi_dbm)
    return detector.tick(scan.time_ns)
