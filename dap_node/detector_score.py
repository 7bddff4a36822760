"""Nearness as a detector: what it misses, what it makes up, from how far and how late (pure)."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from dap_node.proximity import Evidence, Proximity, ProximitySettings, Stays, Witness
from dap_node.true_range import TrueRange
from shared.messages import NodeId
from shared.units import NS_PER_S

Array: TypeAlias = NDArray[np.float64]

TICK_S = 0.2
"""A DAP looks so often, whether it hears anything or not."""

QUIET_S = 10.0
"""It goes on looking for so long after the last reading."""

FALSE_RANGE = 2.0
"""What is told from farther than this many times the range of a pass is a false alarm."""

STATION: NodeId = "station"


class Link(NamedTuple):
    """What a receiver heard of one station, and the truth.

    ``recording`` names the walk it belongs to; readings ``rssi_dbm`` (n ≥ 1), brought to the
    product's scale, are of ``time_s`` (n,), ascending, in the time of ``true_range``.
    """

    recording: str
    time_s: Array
    rssi_dbm: Array
    true_range: TrueRange


class DetectorTrial(NamedTuple):
    """How a detector did on one link that was watched for ``watched_s``.

    Of the ``passes``, ``missed`` had no event; of the others ``delay_s`` is from the moment they
    began until the first event was told. ``entered_m`` are the ranges at the times that the
    beginnings of stays tell. ``false_stays`` of these were false alarms, and ``false_events`` of
    all ``events``, of which there is one for each second of a stay.
    """

    watched_s: float
    passes: int
    missed: int
    delay_s: Array
    entered_m: Array
    false_stays: int
    events: int
    false_events: int


class DetectorScore(NamedTuple):
    """Trials together; ranges and delays are NaN where there was nothing to measure."""

    watched_h: float
    passes: int
    missed: int
    stays: int
    events: int
    false_stays_per_h: float
    false_events_per_h: float
    range_p50_m: float
    range_p95_m: float
    delay_p50_s: float
    delay_p95_s: float


def evidence_of(link: Link, settings: ProximitySettings) -> list[Evidence]:
    """Return what there is to judge by, tick by tick."""
    witness = Witness(settings, believes=True)
    time_ns = [round(time_s * NS_PER_S) for time_s in link.time_s.tolist()]
    rssi_dbm = link.rssi_dbm.tolist()
    heard, told = 0, []
    first, last = int(link.time_s[0] / TICK_S), int((link.time_s[-1] + QUIET_S) / TICK_S)
    for tick in range(first, last + 1):
        now_ns = round(tick * TICK_S * NS_PER_S)
        while heard < len(time_ns) and time_ns[heard] <= now_ns:
            witness.add(time_ns[heard], rssi_dbm[heard])
            heard += 1
        told.append(witness.testify(now_ns))
    return told


def try_detector(
    evidence: Sequence[Evidence], settings: ProximitySettings, true_range: TrueRange, pass_m: float
) -> DetectorTrial:
    """Return how the detector with ``settings`` decides on ``evidence`` (n ≥ 1), tick by tick."""
    stays = Stays(STATION, settings)
    told = [(one.now_ns, event) for one in evidence if (event := stays.decide(one)) is not None]
    return _trial(told, true_range, pass_m, (evidence[-1].now_ns - evidence[0].now_ns) / NS_PER_S)


def score_detector(trials: Iterable[DetectorTrial]) -> DetectorScore:
    """Sum up ``trials`` (n ≥ 1)."""
    every = list(trials)
    entered_m = np.concatenate([one.entered_m for one in every])
    delay_s = np.concatenate([one.delay_s for one in every])
    watched_h = sum(one.watched_s for one in every) / 3600.0
    return DetectorScore(
        watched_h=watched_h,
        passes=sum(one.passes for one in every),
        missed=sum(one.missed for one in every),
        stays=len(entered_m),
        events=sum(one.events for one in every),
        false_stays_per_h=sum(one.false_stays for one in every) / watched_h,
        false_events_per_h=sum(one.false_events for one in every) / watched_h,
        range_p50_m=_percentile(entered_m, 50.0),
        range_p95_m=_percentile(entered_m, 95.0),
        delay_p50_s=_percentile(delay_s, 50.0),
        delay_p95_s=_percentile(delay_s, 95.0),
    )


def _trial(
    told: Sequence[tuple[int, Proximity]], true_range: TrueRange, pass_m: float, watched_s: float
) -> DetectorTrial:
    near = [(now_ns, event) for now_ns, event in told if event.phase != "left"]
    told_s = np.array([now_ns / NS_PER_S for now_ns, _ in near])
    time_s = np.array([event.time_ns / NS_PER_S for _, event in near])
    begins = np.array([event.phase == "entered" for _, event in near], dtype=bool)
    range_m = true_range.at(time_s)
    is_false = range_m > FALSE_RANGE * pass_m
    passes = true_range.passes(pass_m)
    held = [one.holds(time_s) for one in passes]
    return DetectorTrial(
        watched_s=watched_s,
        passes=len(passes),
        missed=sum(not one.any() for one in held),
        delay_s=np.array(
            [
                told_s[which].min() - one.begin_s
                for one, which in zip(passes, held, strict=True)
                if which.any()
            ]
        ),
        entered_m=range_m[begins],
        false_stays=int(is_false[begins].sum()),
        events=len(near),
        false_events=int(is_false.sum()),
    )


def _percentile(values: Array, share: float) -> float:
    return float(np.percentile(values, share)) if len(values) else float("nan")
