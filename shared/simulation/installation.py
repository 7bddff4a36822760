"""Where and when a DAP was really set down."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from shared.messages import NodeId
from shared.simulation.chance import generator
from shared.simulation.faults import swap_of
from shared.simulation.scenario import Scenario
from shared.simulation.walker import simulate_walk

REACH_M = 0.4
"""How far from the hip a person sets something down."""


def is_set_down(scenario: Scenario, dap_id: NodeId, seed: int) -> bool:
    """Say whether ``dap_id`` is ever installed: of those that are carried, some are not."""
    if scenario.daps[dap_id].position_m is not None:
        return True
    installer_id = dict(scenario.installations)[dap_id]
    return dap_id in simulate_walk(scenario, installer_id, seed).installed


def installation_truth(
    scenario: Scenario, dap_id: NodeId, seed: int
) -> tuple[float, NDArray[np.float64], NodeId | None]:
    """Return when (s), where ((3,) NED, on the floor) and by whom ``dap_id`` was installed.

    A DAP at a known place stands there from time 0 and has no installer. Others stand at arm's
    length before their installer, to either side. Raises ``ValueError`` for one that its carrier
    never set down.
    """
    known = scenario.daps[dap_id].position_m
    if known is not None:
        return 0.0, np.array(known), None
    installer_id = dict(scenario.installations)[dap_id]
    walk = simulate_walk(scenario, installer_id, seed)
    time_s = walk.installed.get(dap_id)
    if time_s is None:
        raise ValueError(f"{dap_id} is never set down in the exercise of seed {seed}")
    position_m, heading_rad = walk.body.at(np.array([time_s]))
    side_rad = generator(seed, "installation", dap_id).uniform(-np.pi / 2.0, np.pi / 2.0)
    toward_rad = heading_rad[0] + side_rad
    reach_m = REACH_M * np.array([np.cos(toward_rad), np.sin(toward_rad), 0.0])
    return time_s, position_m[0] + reach_m, installer_id


class Stood(NamedTuple):
    """Which box goes by a DAP's name since when (s), and where it stands ((3,) NED)."""

    since_s: float
    box_id: NodeId
    place_m: NDArray[np.float64]


def places_of(scenario: Scenario, dap_id: NodeId, seed: int) -> list[Stood]:
    """Return where what goes by the name of ``dap_id`` stands, from its installation on, by time.

    Somebody may put it elsewhere, and two may go by each other's names. Raises ``ValueError`` for
    one that its carrier never set down.
    """
    installed_s, place_m, _ = installation_truth(scenario, dap_id, seed)
    stood = [Stood(installed_s, dap_id, place_m)]
    fault = scenario.fault_of(dap_id)
    put_m = fault.moved_to_m
    if fault.moved_by_m is not None:
        put_m = place_m + np.array(fault.moved_by_m)
    if put_m is not None:
        moved_s = max(fault.since_s, installed_s)
        stood.append(Stood(moved_s, dap_id, np.array(put_m)))
        stood += _put_back(fault.until_s, moved_s, dap_id, place_m)
    swap = swap_of(scenario.faults, dap_id)
    if swap is not None and is_set_down(scenario, swap.other_id, seed):
        other_s, other_m, _ = installation_truth(scenario, swap.other_id, seed)
        swapped_s = max(swap.fault.since_s, installed_s, other_s)
        stood.append(Stood(swapped_s, swap.other_id, other_m))
        stood += _put_back(swap.fault.until_s, swapped_s, dap_id, place_m)
    return sorted(stood, key=lambda each: each.since_s)


def _put_back(
    until_s: float, since_s: float, dap_id: NodeId, place_m: NDArray[np.float64]
) -> list[Stood]:
    return [Stood(max(until_s, since_s), dap_id, place_m)] if math.isfinite(until_s) else []
