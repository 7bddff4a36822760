"""What a DAP hears in an exercise: readings of signal strength, scan by scan."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from shared.messages import NodeId
from shared.simulation.chance import generator
from shared.simulation.faults import Fault, swap_of
from shared.simulation.installation import is_set_down, places_of
from shared.simulation.link import Link
from shared.simulation.propagation import probability_heard
from shared.simulation.scenario import Scenario
from shared.simulation.walker import simulate_walk

Array: TypeAlias = NDArray[np.float64]

SCAN_JITTER = 0.1
"""Scans come early or late by up to this share of their period."""

JAM_S = 4.0
JAM_SHARE = 0.15
JAM_DBM = (-65.0, -40.0)
"""Who jams a DAP lets it hear each responder for so long, for so much of the time, so loudly."""


class RadioChannel:
    """The link between a DAP, from its installation on at ``dap_m`` (3,), and a responder.

    Raises ``ValueError`` for a DAP that is never set down.
    """

    def __init__(self, scenario: Scenario, dap_id: NodeId, responder_id: NodeId, seed: int) -> None:
        self._radio = scenario.radio
        self._body = simulate_walk(scenario, responder_id, seed).body
        first, *later = places_of(scenario, dap_id, seed)
        self._installed_s, self.dap_m = first.since_s, first.place_m
        self._link = Link(scenario, dap_id, responder_id, seed, self.dap_m)
        self._later = [
            (each.since_s, Link(scenario, each.box_id, responder_id, seed, each.place_m))
            for each in later
        ]
        self._scans = (seed, "scans", dap_id)
        self._noise = (seed, "readings", dap_id, responder_id)

    @property
    def end_s(self) -> float:
        """When the responder is done."""
        return float(self._body.time_s[-1])

    def power_dbm(self, body_m: Array, heading_rad: Array) -> Array:
        """Return the power (n,) at the DAP of the responder at ``body_m`` (n, 3), noise apart."""
        return self._link.power_dbm(body_m, heading_rad)

    def scan_times_s(self, until_s: float) -> Array:
        """Return when the DAP scans, whoever is there: the same for all its channels."""
        period_s = 1.0 / self._radio.scan_rate_hz
        count = max(0, int((until_s - self._installed_s) / period_s))
        jitter = generator(*self._scans).uniform(-SCAN_JITTER, SCAN_JITTER, count)
        return np.asarray(self._installed_s + (np.arange(count) + 0.5 + jitter) * period_s)

    def readings(self) -> tuple[Array, Array]:
        """Return times (s, ascending) and values (dBm, whole numbers) of the readings heard.

        There is one at most for each scan, and none before the responder is there.
        """
        time_s = self.scan_times_s(self.end_s)
        body_m, heading_rad = self._body.at(time_s)
        chance = generator(*self._noise)
        noise_db = self._radio.noise_sd_db * chance.normal(size=len(time_s))
        power_dbm = self.power_dbm(body_m, heading_rad)
        for since_s, link in self._later:
            since = time_s >= since_s
            power_dbm[since] = link.power_dbm(body_m[since], heading_rad[since])
        rssi_dbm = np.round(power_dbm + noise_db)
        heard = chance.random(len(time_s)) < probability_heard(self._radio, rssi_dbm)
        heard &= time_s >= self._body.time_s[0]
        return time_s[heard], rssi_dbm[heard]


@dataclass(frozen=True)
class Scans:
    """All scans of a DAP: ``time_s`` (n,), and of each responder ``rssi_dbm`` (n,), NaN if lost."""

    time_s: Array
    rssi_dbm: dict[NodeId, Array]


def simulate_scans(scenario: Scenario, dap_id: NodeId, seed: int) -> Scans:
    """Return what ``dap_id`` hears in the exercise of ``seed``, until all responders are done.

    One that is never set down hears nothing, for it is not switched on.
    """
    if not is_set_down(scenario, dap_id, seed):
        return Scans(np.empty(0), {name: np.empty(0) for name in scenario.responders})
    channels = {
        responder_id: RadioChannel(scenario, dap_id, responder_id, seed)
        for responder_id in scenario.responders
    }
    last = max(channels.values(), key=lambda channel: channel.end_s)
    time_s = last.scan_times_s(last.end_s)
    rssi_dbm = {}
    for responder_id, channel in channels.items():
        heard_s, values_dbm = channel.readings()
        rssi_dbm[responder_id] = np.full(len(time_s), np.nan)
        rssi_dbm[responder_id][np.searchsorted(time_s, heard_s)] = values_dbm
    named = named_wrongly(scenario, time_s, rssi_dbm)
    fault = scenario.fault_of(dap_id)
    if fault.jammed:
        return Scans(time_s, _jammed(fault, time_s, named, seed, dap_id))
    return Scans(time_s, _replayed(fault, time_s, named))


def named_wrongly(
    scenario: Scenario, time_s: Array, rssi_dbm: Mapping[NodeId, Array]
) -> dict[NodeId, Array]:
    """Return readings (n,) at ``time_s`` (n,) by whose they are held to be: radios are swapped."""

    def readings(name: NodeId, own_dbm: Array) -> Array:
        swap = swap_of(scenario.faults, name)
        if swap is None or swap.other_id not in rssi_dbm:
            return own_dbm
        return np.where(swap.fault.is_so(time_s), rssi_dbm[swap.other_id], own_dbm)

    return {name: readings(name, own_dbm) for name, own_dbm in rssi_dbm.items()}


def _replayed(fault: Fault, time_s: Array, rssi_dbm: dict[NodeId, Array]) -> dict[NodeId, Array]:
    """Return readings with those among them that come once more, where somebody replays them."""
    if fault.replays_s is None or not time_s.size:
        return rssi_dbm
    before = np.searchsorted(time_s, time_s - fault.replays_s, side="right") - 1
    is_replayed = (before >= 0) & fault.is_so(time_s)
    return {
        name: np.where(is_replayed, np.fmax(each_dbm, each_dbm[before]), each_dbm)
        for name, each_dbm in rssi_dbm.items()
    }


def _jammed(
    fault: Fault, time_s: Array, rssi_dbm: dict[NodeId, Array], seed: int, dap_id: NodeId
) -> dict[NodeId, Array]:
    """Return readings with what somebody sends in everybody's name instead of them."""
    spell = (time_s / JAM_S).astype(np.intp)
    count = int(spell.max(initial=0)) + 1
    jammed_dbm = {}
    for name, own_dbm in rssi_dbm.items():
        chance = generator(seed, "jam", dap_id, name)
        loud_dbm = np.round(chance.uniform(*JAM_DBM, count))
        loud_dbm[chance.random(count) >= JAM_SHARE] = np.nan
        jammed_dbm[name] = np.where(fault.is_so(time_s), loud_dbm[spell], own_dbm)
    return jammed_dbm
