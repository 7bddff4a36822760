"""What a unit hears of others and of satellites in a simulated exercise."""

from __future__ import annotations

import heapq
from collections.abc import Iterator

import numpy as np

from edge_agent.cues import Cue, Overheard
from edge_agent.drop_desk import Beacon
from edge_agent.gnss import GnssReading
from shared.messages import NodeId
from shared.simulation.chance import generator
from shared.simulation.gnss import simulate_fixes
from shared.simulation.installation import is_set_down
from shared.simulation.meetings import simulate_meetings
from shared.simulation.radio import RadioChannel
from shared.simulation.scenario import Scenario
from shared.simulation.walker import simulate_walk
from shared.units import NS_PER_S


def simulated_cues(scenario: Scenario, responder_id: NodeId, seed: int) -> Iterator[Cue]:
    """Return the cues of ``responder_id`` in the order of time, from 0 at the exercise's start."""
    return heapq.merge(
        _overheard(scenario, responder_id, seed),
        _gnss_readings(scenario, responder_id, seed),
        key=lambda cue: cue.time_ns,
    )


def simulated_beacons(scenario: Scenario, responder_id: NodeId, seed: int) -> Iterator[Beacon]:
    """Return the DAPs' signals at the unit of ``responder_id``, by time, as loud as it is there."""
    return heapq.merge(
        *(
            _beacons_of(dap_id, RadioChannel(scenario, dap_id, responder_id, seed))
            for dap_id in scenario.daps
            if is_set_down(scenario, dap_id, seed)
        )
    )


def _beacons_of(dap_id: NodeId, channel: RadioChannel) -> Iterator[Beacon]:
    time_s, rssi_dbm = channel.readings()
    for at_s, dbm in zip(time_s.tolist(), rssi_dbm.tolist(), strict=True):
        yield Beacon(_ns(at_s), dap_id, dbm)


def _overheard(scenario: Scenario, responder_id: NodeId, seed: int) -> Iterator[Cue]:
    scans = simulate_meetings(scenario, responder_id, seed)
    for index, time_s in enumerate(scans.time_s.tolist()):
        for other_id, rssi_dbm in scans.rssi_dbm.items():
            if not np.isnan(rssi_dbm[index]):
                yield Overheard(_ns(time_s), other_id, float(rssi_dbm[index]))


def _gnss_readings(scenario: Scenario, responder_id: NodeId, seed: int) -> Iterator[Cue]:
    receiver = scenario.gnss
    if receiver is None:
        return
    body = simulate_walk(scenario, responder_id, seed).body
    time_s = np.arange(body.time_s[0], body.time_s[-1], 1.0 / receiver.rate_hz)
    fixes = simulate_fixes(
        receiver,
        scenario.building,
        time_s,
        body.at(time_s)[0],
        generator(seed, "gnss", responder_id),
    )
    for at_s, (north_m, east_m, down_m), sd_m in zip(
        *(values.tolist() for values in fixes), strict=True
    ):
        yield GnssReading(_ns(at_s), north_m, east_m, down_m, sd_m)


def _ns(time_s: float) -> int:
    return round(time_s * NS_PER_S)
