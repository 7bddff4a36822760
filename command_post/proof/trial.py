"""A trial: one responder's messages and some DAPs', fused, and held against where they were."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple, TypeAlias

import msgspec
import numpy as np
from numpy.typing import NDArray

from command_post.confidence import inside95
from command_post.evaluation.evidence import Evidence, Method
from command_post.evaluation.score_card import Radii, radii
from command_post.incident import Incident, IncidentSettings
from command_post.rehearsing.rehearsal import add_afterwards
from shared.codec import encode
from shared.exercise import REHEARSAL_INCIDENT, REHEARSAL_START_NS
from shared.messages import DapInstallation, LocalPosition, Message, NodeId, RssiPeak
from shared.rssi_peaks import Peak, PeakDetector, PeakSettings
from shared.topics import TOPICS, Key, Role
from shared.units import NS_PER_S

Floats: TypeAlias = NDArray[np.float64]

RESPONDER: NodeId = "r1"
SCAN_NS = NS_PER_S // 5
DAP_SD_M = 0.1
"""How well the places of a trial's DAPs are known, which nobody in it has set down."""

_TOPIC_OF = {topic.message: name for name, topic in TOPICS.items()}


class Heard(NamedTuple):
    """A message that reaches the post at ``now_ns``."""

    now_ns: int
    role: Role
    node_id: NodeId
    message: Message


class Trial(NamedTuple):
    """What is heard, and where the responder was: ``time_s`` (k,) and north, east (k, 2)."""

    name: str
    heard: list[Heard]
    time_s: Floats
    truth_m: Floats


class Outcome(NamedTuple):
    """A trial's errors (k,) in metres, and when the truth was in the region given for 95 %."""

    live_m: Floats
    live_inside: NDArray[np.bool_]
    after_m: Floats
    after_inside: NDArray[np.bool_]


class ProofScore(msgspec.Struct, frozen=True, kw_only=True):
    """Errors of one trial, or of several thrown together; ``None`` where there are none."""

    trials: int
    live: Radii | None
    live_coverage95_pct: float
    after: Radii | None
    after_coverage95_pct: float


def try_out(trial: Trial, settings: IncidentSettings) -> Outcome:
    """Fuse what is heard in a trial, in that order, and return the errors."""
    incident, evidence = Incident(settings), Evidence()
    now_ns = 0
    for now_ns, role, node_id, message in sorted(trial.heard, key=lambda heard: heard[0]):
        key = str(Key(settings.incident, role, node_id, _TOPIC_OF[type(message)]))
        for told in incident.handle(key, encode(message), now_ns):
            evidence.add_wire(told.key, told.payload)
    for told in incident.finish(now_ns):
        evidence.add_wire(told.key, told.payload)
    add_afterwards(evidence, incident)
    live_m, live_inside = _errors(evidence, "live", trial)
    return Outcome(live_m, live_inside, *_errors(evidence, "after", trial))


def summed_up(outcomes: Sequence[Outcome]) -> ProofScore:
    """Throw the errors of several trials (one or more) together."""
    return ProofScore(
        trials=len(outcomes),
        live=radii(outcome.live_m for outcome in outcomes),
        live_coverage95_pct=_percent(outcome.live_inside for outcome in outcomes),
        after=radii(outcome.after_m for outcome in outcomes),
        after_coverage95_pct=_percent(outcome.after_inside for outcome in outcomes),
    )


def stands_at(place_m: Floats, dap_id: NodeId) -> Heard:
    """Return a DAP's word that it stands at a known place (2,) from the first."""
    north_m, east_m = place_m.tolist()
    variance_m2 = DAP_SD_M**2
    said = DapInstallation(
        event_time_ns=REHEARSAL_START_NS,
        sequence=0,
        installer_id=None,
        position=LocalPosition(
            north_m=north_m,
            east_m=east_m,
            down_m=0.0,
            covariance_m2=(variance_m2, 0.0, variance_m2),
        ),
    )
    return Heard(REHEARSAL_START_NS, "dap", dap_id, said)


def peaks_told(
    dap_id: NodeId, time_s: Floats, rssi_dbm: Floats, until_s: float, settings: PeakSettings
) -> list[Heard]:
    """Return the peaks that a DAP tells of the readings (n,) of the responder, as they end."""
    detector, told = PeakDetector(settings), 0
    heard: list[Heard] = []
    readings = iter(zip(time_s.tolist(), rssi_dbm.tolist(), strict=True))
    reading = next(readings, None)
    for scan_ns in range(0, round(until_s * NS_PER_S), SCAN_NS):
        while reading is not None and round(reading[0] * NS_PER_S) <= scan_ns:
            detector.add(round(reading[0] * NS_PER_S), RESPONDER, reading[1])
            reading = next(readings, None)
        for peak in detector.tick(scan_ns):
            now_ns = REHEARSAL_START_NS + scan_ns
            heard.append(Heard(now_ns, "dap", dap_id, _message(peak, told)))
            told += 1
    return heard


def trial_settings(settings: IncidentSettings) -> IncidentSettings:
    """Return ``settings`` for the incident that trials belong to."""
    return msgspec.structs.replace(settings, incident=REHEARSAL_INCIDENT)


def _message(peak: Peak, sequence: int) -> RssiPeak:
    return RssiPeak(
        event_time_ns=REHEARSAL_START_NS + peak.time_ns,
        sequence=sequence,
        responder_id=peak.station_id,
        peak_dbm=peak.peak_dbm,
        width_s=peak.width_s,
        sample_count=peak.sample_count,
    )


def _errors(evidence: Evidence, method: Method, trial: Trial) -> tuple[Floats, NDArray[np.bool_]]:
    track = evidence.tracks(method).get(RESPONDER)
    if track is None:
        return np.empty(0), np.empty(0, np.bool_)
    # Before the first word of a responder there is nothing to be right or wrong.
    scored = trial.time_s >= track.time_s[0]
    at = track.at(trial.time_s[scored])
    error_m = at.position_m[:, :2] - trial.truth_m[scored]
    covariance_m2 = at.covariance_m2
    inside = (
        np.zeros(len(error_m), np.bool_)
        if covariance_m2 is None
        else inside95(error_m, covariance_m2)
    )
    return np.hypot(error_m[:, 0], error_m[:, 1]), inside


def _percent(inside: Iterable[NDArray[np.bool_]]) -> float:
    return 100.0 * float(np.mean(np.concatenate(list(inside))))
