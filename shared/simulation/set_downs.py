"""DAPs that are set down as their carriers decide on the way: every so far, or as they are advised.

Nobody knows the plan, nor where others will go. What an adviser is told is what a responder's unit
would know: its movements, and how loud the DAPs are that stand by then.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterator
from typing import NamedTuple, Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray

from shared.drop_adviser import DropAdviser
from shared.messages import NodeId, Vector3
from shared.simulation.chance import generator
from shared.simulation.gaits import ACTIVITIES
from shared.simulation.link import Link
from shared.simulation.propagation import probability_heard
from shared.simulation.route import Footfall, Route
from shared.simulation.scenario import Responder, Scenario
from shared.units import NS_PER_S

Array: TypeAlias = NDArray[np.float64]

SET_DOWN_S = 4.0
READINGS_A_STRIDE = 5
ON_THE_WAY = frozenset({"spaced", "advised"})


def stance_times_s(falls: list[Footfall], start_s: float) -> tuple[Array, Array]:
    """Return when the boot reaches each footfall and when it leaves (k,), begun at ``start_s``."""
    dwell_s = np.array([fall.dwell_s for fall in falls])
    reached_s = start_s + np.cumsum([fall.stride_s for fall in falls])
    reached_s[1:] += np.cumsum(dwell_s)[:-1]
    return reached_s, reached_s + dwell_s


def stop_to_set_down(route: Route, dap_id: NodeId, footfall: int) -> None:
    """Have the walker stand at a footfall for as long as it takes to set ``dap_id`` down."""
    fall = route.footfalls[footfall]
    route.installs[dap_id] = (footfall, fall.dwell_s + 0.5 * SET_DOWN_S)
    route.footfalls[footfall] = fall._replace(dwell_s=fall.dwell_s + SET_DOWN_S)


def set_down_on_the_way(scenario: Scenario, routes: dict[NodeId, Route], seed: int) -> None:
    """Let those who decide on the way set down what they carry, all in the order of time."""
    carriers = {
        name: _Carrier(scenario, name, route.footfalls, seed)
        for name, route in routes.items()
        if scenario.responders[name].sets_down in ON_THE_WAY and scenario.responders[name].carries
    }
    for dap_id, since_s, place_m in _standing(scenario, routes):
        for carrier in carriers.values():
            carrier.hears(dap_id, since_s, place_m)
    waiting = [(carrier.time_s(1), name, 1) for name, carrier in carriers.items()]
    heapq.heapify(waiting)
    while waiting:
        time_s, name, footfall = heapq.heappop(waiting)
        carrier = carriers[name]
        if carrier.decides(footfall, time_s):
            dap_id = carrier.take_one()
            stop_to_set_down(routes[name], dap_id, footfall)
            place_m = routes[name].footfalls[footfall].body_m
            for each in carriers.values():
                each.hears(dap_id, time_s + 0.5 * SET_DOWN_S, place_m)
        if carrier.carried and footfall + 1 < len(routes[name].footfalls):
            heapq.heappush(waiting, (carrier.time_s(footfall + 1), name, footfall + 1))


def _standing(
    scenario: Scenario, routes: dict[NodeId, Route]
) -> Iterator[tuple[NodeId, float, Array]]:
    """Yield the DAPs that stand whatever is decided: which, since when (s), and where (3,)."""
    for dap_id, dap in scenario.daps.items():
        if dap.position_m is not None:
            yield dap_id, 0.0, np.array(dap.position_m)
    for name, route in routes.items():
        reached_s, _ = stance_times_s(route.footfalls, scenario.responders[name].start_s)
        for dap_id, (footfall, after_s) in route.installs.items():
            yield dap_id, float(reached_s[footfall]) + after_s, route.footfalls[footfall].body_m


class _Decider(Protocol):
    """Says at each footfall whether to set one down there; told once that this is done."""

    def wants(self, time_ns: int, displacement_m: Vector3, fall: Footfall) -> bool: ...

    def set_down(self) -> None: ...


class _Spaced:
    """One after every so many metres walked."""

    def __init__(self, spacing_m: float) -> None:
        self._spacing_m = spacing_m
        self._since_m = 0.0

    def wants(self, time_ns: int, displacement_m: Vector3, fall: Footfall) -> bool:  # noqa: ARG002
        """Count the metres."""
        self._since_m += float(np.hypot(displacement_m[0], displacement_m[1]))
        return self._since_m >= self._spacing_m

    def set_down(self) -> None:
        """Count from here."""
        self._since_m = 0.0


class _Advised:
    """Where the unit says so."""

    def __init__(self, boxes: int) -> None:
        self._adviser = DropAdviser(boxes)
        self.hear = self._adviser.hear
        self.set_down = self._adviser.set_down

    def wants(self, time_ns: int, displacement_m: Vector3, fall: Footfall) -> bool:
        """Do as the unit says."""
        return self._adviser.move(time_ns, displacement_m, ACTIVITIES[fall.gait]) is not None


class _Heard(NamedTuple):
    """A DAP as heard by one responder, ``rssi_dbm`` (k, readings) on the way to each footfall."""

    since_s: float
    rssi_dbm: Array


class _Carrier:
    """One who carries DAPs: their way, when they get where, and what their unit hears there."""

    def __init__(self, scenario: Scenario, name: NodeId, falls: list[Footfall], seed: int) -> None:
        responder = scenario.responders[name]
        self.carried = list(responder.carries)
        self._scenario, self._name, self._seed = scenario, name, seed
        self._decider: _Decider = _decider(responder)
        self._falls = falls
        self._planned_s = stance_times_s(falls, responder.start_s)[0]
        self._late_s = 0.0
        self._body_m = np.array([fall.body_m for fall in falls])
        self._facing_rad = np.array([fall.facing_rad for fall in falls])
        self._heard: dict[NodeId, _Heard] = {}

    def time_s(self, footfall: int) -> float:
        """Return when the walker reaches a footfall, late as they are by now."""
        return float(self._planned_s[footfall]) + self._late_s

    def hears(self, dap_id: NodeId, since_s: float, place_m: Array) -> None:
        """Have a DAP stand at ``place_m`` (3,) since then, for a unit that heeds the radio."""
        if not isinstance(self._decider, _Advised):
            return
        radio = self._scenario.radio
        share = (np.arange(READINGS_A_STRIDE) + 1.0) / READINGS_A_STRIDE
        steps = np.diff(self._body_m, axis=0)[:, None, :]
        body_m = (self._body_m[:-1, None, :] + share[None, :, None] * steps).reshape(-1, 3)
        facing_rad = np.repeat(self._facing_rad[1:], READINGS_A_STRIDE)
        power_dbm = Link(self._scenario, dap_id, self._name, self._seed, place_m).power_dbm(
            body_m, facing_rad
        )
        chance = generator(self._seed, "beacons", dap_id, self._name)
        rssi_dbm = np.round(power_dbm + radio.noise_sd_db * chance.normal(size=power_dbm.size))
        rssi_dbm[chance.random(power_dbm.size) >= probability_heard(radio, rssi_dbm)] = np.nan
        self._heard[dap_id] = _Heard(since_s, rssi_dbm.reshape(-1, READINGS_A_STRIDE))

    def decides(self, footfall: int, time_s: float) -> bool:
        """Whether one is set down at ``footfall``, reached at ``time_s``."""
        fall = self._falls[footfall]
        if isinstance(self._decider, _Advised):
            self._listen(self._decider, footfall, time_s)
        north_m, east_m, down_m = (self._body_m[footfall] - self._body_m[footfall - 1]).tolist()
        return self._decider.wants(_ns(time_s), (north_m, east_m, down_m), fall)

    def _listen(self, unit: _Advised, footfall: int, time_s: float) -> None:
        """Have the unit hear what stands already, on the way to ``footfall``."""
        stride_s = self._falls[footfall].stride_s
        for dap_id, heard in self._heard.items():
            if time_s < heard.since_s:
                continue
            for back, rssi_dbm in enumerate(heard.rssi_dbm[footfall - 1][::-1].tolist()):
                if not np.isnan(rssi_dbm):
                    at_s = time_s - stride_s * back / READINGS_A_STRIDE
                    unit.hear(_ns(at_s), dap_id, rssi_dbm)

    def take_one(self) -> NodeId:
        """Return the next of those carried: it is set down here, which takes its time."""
        self._decider.set_down()
        self._late_s += SET_DOWN_S
        return self.carried.pop(0)


def _decider(responder: Responder) -> _Decider:
    if responder.sets_down == "spaced":
        return _Spaced(responder.spacing_m)
    return _Advised(len(responder.carries))


def _ns(time_s: float) -> int:
    return round(time_s * NS_PER_S)
