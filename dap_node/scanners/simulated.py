"""The scanner of a simulated exercise."""

from __future__ import annotations

import heapq
from collections.abc import Callable, Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

from dap_node.scanners.observation import Observation, PutElsewhere, Scan, SetDown
from shared.messages import LocalPosition, NodeId, Vector3
from shared.simulation.faults import swap_of
from shared.simulation.installation import installation_truth, is_set_down, places_of
from shared.simulation.radio import simulate_scans
from shared.simulation.scenario import Scenario
from shared.units import NS_PER_S

SURVEYED_SD_M = 0.1
"""How well a DAP that stands at a known place is placed there."""

EMPTY_SCANS_S = 5.0
"""Scanning goes on for so long after the exercise, so that every stay is seen to end."""


class SimulatedScanner:
    """What a DAP of ``scenario`` meets with in the exercise of ``seed``, worked out beforehand."""

    def __init__(self, scenario: Scenario, dap_id: NodeId, seed: int) -> None:
        """Raise ``ValueError`` if the scenario has no such DAP."""
        if dap_id not in scenario.daps:
            known = ", ".join(scenario.daps) or "none"
            raise ValueError(f"no DAP {dap_id!r} in the scenario; there are: {known}")
        self._installed = (
            installation_truth(scenario, dap_id, seed)
            if is_set_down(scenario, dap_id, seed)
            else None
        )
        self._moved = places_of(scenario, dap_id, seed)[1:] if self._installed else []
        self._is_surveyed = scenario.daps[dap_id].position_m is not None
        self._scans = simulate_scans(scenario, dap_id, seed)
        self._faults = scenario.faults
        self._period_s = 1.0 / scenario.radio.scan_rate_hz

    def observations(self, start_ns: int) -> Iterator[Observation]:
        """Yield the installation and all scans of an exercise that starts at ``start_ns``.

        There are none of a DAP that is never set down.
        """
        if self._installed is None:
            return
        installed_s, place_m, installer_id = self._installed
        swap = None if installer_id is None else swap_of(self._faults, installer_id)
        if swap is not None and swap.fault.is_so(installed_s):
            # Who set it down is who is heard.
            installer_id = swap.other_id
        truth_m = _vector(place_m)

        def at(time_s: float) -> int:
            return start_ns + round(time_s * NS_PER_S)

        yield SetDown(at(installed_s), installer_id, self._position(truth_m), truth_m)
        moved = [PutElsewhere(at(each.since_s), _vector(each.place_m)) for each in self._moved]
        all_of_it: list[Iterable[Observation]] = [moved, self._all_scans(at, installed_s)]
        yield from heapq.merge(*all_of_it, key=lambda each: each.time_ns)

    def _all_scans(self, at: Callable[[float], int], installed_s: float) -> Iterator[Scan]:
        for index, time_s in enumerate(self._scans.time_s):
            heard = {
                responder_id: float(rssi_dbm[index])
                for responder_id, rssi_dbm in self._scans.rssi_dbm.items()
                if not np.isnan(rssi_dbm[index])
            }
            yield Scan(at(float(time_s)), heard)
        end_s = float(self._scans.time_s[-1]) if len(self._scans.time_s) else installed_s
        for after_s in np.arange(self._period_s, EMPTY_SCANS_S, self._period_s):
            yield Scan(at(end_s + float(after_s)), {})

    def _position(self, truth_m: Vector3) -> LocalPosition | None:
        if not self._is_surveyed:
            return None
        north_m, east_m, down_m = truth_m
        variance_m2 = SURVEYED_SD_M**2
        return LocalPosition(
            north_m=north_m,
            east_m=east_m,
            down_m=down_m,
            covariance_m2=(variance_m2, 0.0, variance_m2),
        )


def _vector(place_m: NDArray[np.float64]) -> Vector3:
    north_m, east_m, down_m = place_m.tolist()
    return north_m, east_m, down_m
