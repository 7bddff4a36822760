"""What a responder's unit hears of the other responders' radios in an exercise."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from shared.messages import NodeId
from shared.simulation.chance import generator
from shared.simulation.propagation import (
    draw_surroundings,
    power_between_worn_dbm,
    probability_heard,
)
from shared.simulation.radio import SCAN_JITTER, Scans, named_wrongly
from shared.simulation.scenario import Scenario
from shared.simulation.walker import simulate_walk

Array: TypeAlias = NDArray[np.float64]


def simulate_meetings(scenario: Scenario, responder_id: NodeId, seed: int) -> Scans:
    """Return what ``responder_id`` hears of each other while both take part."""
    body = simulate_walk(scenario, responder_id, seed).body
    period_s = 1.0 / scenario.radio.scan_rate_hz
    count = int((body.time_s[-1] - body.time_s[0]) / period_s)
    jitter = generator(seed, "scans of responder", responder_id).uniform(
        -SCAN_JITTER, SCAN_JITTER, count
    )
    time_s = body.time_s[0] + (np.arange(count) + 0.5 + jitter) * period_s
    rssi_dbm = {
        other_id: _heard(scenario, responder_id, other_id, seed, time_s)
        for other_id in scenario.responders
        if other_id != responder_id
    }
    return Scans(time_s, named_wrongly(scenario, time_s, rssi_dbm))


def _heard(
    scenario: Scenario, hearer_id: NodeId, heard_id: NodeId, seed: int, time_s: Array
) -> Array:
    """Return the readings (n,) at ``time_s`` (n,), NaN where there is none.

    Place for place the link is the same in both directions; its noise is not.
    """
    radio = scenario.radio
    pair = sorted((hearer_id, heard_id))
    bodies = [simulate_walk(scenario, one, seed).body for one in pair]
    worn = [generator(seed, "radio of responder", one).normal() for one in pair]
    power_dbm = radio.responder_offset_sd_db * sum(worn) + power_between_worn_dbm(
        radio,
        scenario.building,
        draw_surroundings(radio, generator(seed, "surroundings", *pair)),
        bodies[0].at(time_s),
        bodies[1].at(time_s),
    )
    chance = generator(seed, "readings", hearer_id, heard_id)
    rssi_dbm = np.round(power_dbm + radio.noise_sd_db * chance.normal(size=len(time_s)))
    heard = chance.random(len(time_s)) < probability_heard(radio, rssi_dbm)
    for body in bodies:
        heard &= (time_s >= body.time_s[0]) & (time_s <= body.time_s[-1])
    return np.where(heard, rssi_dbm, np.nan)
