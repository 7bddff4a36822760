"""How a DAP does on real readings: every receiver of a walk stands for one (docs)."""

from __future__ import annotations

import numpy as np

from dap_node.evaluation import LinkTrial, try_links
from dap_node.scanners.observation import Scan
from dap_node.settings import DapSettings
from dap_node.true_range import TrueRange
from shared.messages import NodeId
from shared.units import NS_PER_S
from shared.walk_by import WalkBy

BEACON: NodeId = "beacon"
SCAN_PERIOD_S = 0.2
EMPTY_SCANS_S = 10.0


def try_receivers(recording: WalkBy, settings: DapSettings, pass_m: float) -> list[LinkTrial]:
    """Return how each receiver did. The range is horizontal; scans without readings lie between."""
    end_s = recording.time_s[-1] + EMPTY_SCANS_S
    empty = [Scan(_ns(time_s), {}) for time_s in np.arange(0.0, end_s, SCAN_PERIOD_S).tolist()]
    trials = []
    for receiver, place_m in enumerate(recording.receiver_m):
        own = recording.receiver == receiver
        readings = [
            Scan(_ns(time_s), {BEACON: rssi_dbm})
            for time_s, rssi_dbm in zip(
                recording.time_s[own].tolist(), recording.rssi_dbm[own].tolist(), strict=True
            )
        ]
        range_m = np.linalg.norm((recording.beacon_m - place_m)[:, :2], axis=1)
        trials += try_links(
            sorted([*empty, *readings], key=lambda scan: scan.time_ns),
            {BEACON: TrueRange(recording.time_s, range_m)},
            settings,
            pass_m,
        )
    return trials


def _ns(time_s: float) -> int:
    return round(time_s * NS_PER_S)
