"""How loud one responder's radio is at one DAP, place by place, in one exercise."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from shared.messages import NodeId
from shared.simulation.chance import generator
from shared.simulation.propagation import draw_surroundings, received_power_dbm
from shared.simulation.scenario import Scenario

Array: TypeAlias = NDArray[np.float64]


class Link:
    """The link, alike in both directions, between a DAP that stands at ``dap_m`` (3,) and one."""

    def __init__(
        self, scenario: Scenario, dap_id: NodeId, responder_id: NodeId, seed: int, dap_m: Array
    ) -> None:
        radio = scenario.radio
        self._radio = radio
        self._plan = scenario.building
        self.dap_m = dap_m
        self._around = draw_surroundings(radio, generator(seed, "surroundings", dap_id))
        worn = generator(seed, "radio of responder", responder_id).normal()
        laid = generator(seed, "radio of DAP", dap_id).normal()
        self._offset_db = radio.responder_offset_sd_db * worn + radio.dap_offset_sd_db * laid

    def power_dbm(self, body_m: Array, heading_rad: Array) -> Array:
        """Return the power (n,) with the responder at ``body_m`` (n, 3), noise apart."""
        return self._offset_db + received_power_dbm(
            self._radio, self._plan, self._around, self.dap_m, body_m, heading_rad
        )
