"""What a DAP's TOML file may say."""

from __future__ import annotations

from typing import Annotated

import msgspec
from msgspec import Meta

from dap_node.proximity import ProximitySettings
from shared.rssi_peaks import PeakSettings


class DapSettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """How a DAP makes nearness and peaks of what its radio hears.

    ``offset_db`` is added to every reading before that, so that radios of any make may be judged
    alike: it brings an average responder at a clear metre to −40 dBm, for which the thresholds,
    and what the post makes of a peak, are meant. Readings are reported as they were heard.
    """

    offset_db: Annotated[float, Meta(ge=-60.0, le=60.0)] = 0.0
    proximity: ProximitySettings = ProximitySettings()
    peaks: PeakSettings = PeakSettings()
