"""A rehearsal at the level of strides: what an agent would say, with no sensor simulated."""

from __future__ import annotations

import heapq
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple, TypeAlias

import numpy as np

from edge_agent.cues import Cue, CueDesk, Overheard
from edge_agent.gnss import GnssReading
from edge_agent.sources.simulated_cues import simulated_cues
from shared.bus.wire_log import WireLogBus
from shared.clock import ManualClock
from shared.exercise import REHEARSAL_INCIDENT, REHEARSAL_START_NS
from shared.messages import Message, NodeId, OdometryIncrement, TrackStart, Truth, Vector3
from shared.sender import Sender
from shared.simulation.gaits import ACTIVITIES
from shared.simulation.odometry import Stride, UnitStart, as_increment, simulate_odometry
from shared.simulation.scenario import Scenario
from shared.simulation.walker import simulate_walk
from shared.topics import TOPICS
from shared.units import NS_PER_S

METHOD = "strides"

_Told: TypeAlias = UnitStart | Stride | Vector3
"""What goes out as it is; a vector is the truth."""


class _Saying(NamedTuple):
    """Something that comes to the unit or goes out, at ``time_s`` of the exercise, by rank."""

    time_s: float
    rank: int
    said: _Told | Cue


def rehearse_strides(scenario: Scenario, responder_id: NodeId, seed: int, folder: Path) -> None:
    """Write the wire log of ``responder_id`` in the exercise of ``seed`` to ``folder``."""
    folder.mkdir(parents=True, exist_ok=True)
    clock = ManualClock(REHEARSAL_START_NS)
    fault = scenario.fault_of(responder_id)
    with WireLogBus(folder / f"{responder_id}.wire", clock) as bus:
        sender = Sender(bus, REHEARSAL_INCIDENT, "responder", responder_id)
        unit = CueDesk(sender)
        for saying in _sayings(scenario, responder_id, seed):
            ahead_s = fault.clock_ahead_at_s(saying.time_s)
            clock.set_ns(_time_ns(saying.time_s))
            now_ns = _time_ns(saying.time_s + ahead_s)
            unit.pass_time(now_ns)
            if isinstance(saying.said, (Overheard, GnssReading)):
                unit.take(saying.said._replace(time_ns=now_ns))
            else:
                sender.send(_message(saying.said, saying.time_s, sender, ahead_s))


def _sayings(scenario: Scenario, responder_id: NodeId, seed: int) -> Iterator[_Saying]:
    body = simulate_walk(scenario, responder_id, seed).body
    period_s = 1.0 / TOPICS["truth"].rate_hz
    time_s = np.arange(body.time_s[0], body.time_s[-1], period_s)
    position_m, _ = body.at(time_s)
    truths = [
        _Saying(at_s, 0, (north_m, east_m, down_m))
        for at_s, (north_m, east_m, down_m) in zip(
            time_s.tolist(), position_m.tolist(), strict=True
        )
    ]
    told = [
        _Saying(each.time_s if isinstance(each, UnitStart) else each.end_s, 1, each)
        for each in simulate_odometry(scenario, responder_id, seed)
    ]
    cues = (
        _Saying(cue.time_ns / NS_PER_S, 1, cue)
        for cue in simulated_cues(scenario, responder_id, seed)
    )
    return heapq.merge(truths, told, cues, key=lambda saying: saying[:2])


def _message(said: _Told, time_s: float, sender: Sender, ahead_s: float) -> Message:
    """Return what is said as a message; a unit whose clock is wrong gives wrong times."""
    event_ns = _time_ns(time_s + ahead_s)
    match said:
        case UnitStart():
            return TrackStart(
                event_time_ns=event_ns,
                sequence=sender.next_sequence(TrackStart),
                position=said.position,
                heading_sd_rad=said.heading_sd_rad,
                mount="boot",
                method=METHOD,
            )
        case Stride():
            start_ns = _time_ns(said.start_s + ahead_s)
            number = sender.next_sequence(OdometryIncrement)
            return as_increment(said, start_ns, event_ns, number, ACTIVITIES[said.gait])
    north_m, east_m, down_m = said
    return Truth(
        event_time_ns=_time_ns(time_s),
        sequence=sender.next_sequence(Truth),
        north_m=north_m,
        east_m=east_m,
        down_m=down_m,
    )


def _time_ns(time_s: float) -> int:
    return REHEARSAL_START_NS + round(time_s * NS_PER_S)
