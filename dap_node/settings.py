"""What a DAP's TOML file may say."""

from __future__ import annotations

from typing import Annotated, TypeAlias

import msgspec
from msgspec import Meta

from dap_node.calibration import CalibrationSettings, Scale
from dap_node.proximity import ProximitySettings
from shared.messages import NodeId
from shared.rssi_peaks import PeakSettings

Offset: TypeAlias = Annotated[float, Meta(ge=-60.0, le=60.0)]


class DapSettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """How a DAP makes nearness and peaks of what its radio hears.

    ``offset_db`` is added to every reading before that, so that radios of any make may be judged
    alike: it brings an average responder at a clear metre to −40 dBm, for which the thresholds,
    and what the post makes of a peak, are meant. ``model_offset_db`` is added as well to readings
    of a model of radio, and ``model_of`` names the responders' models. With a ``calibration`` the
    DAP learns from its installer what is left. Readings are reported as they were heard.
    """

    offset_db: Offset = 0.0
    model_offset_db: dict[str, Offset] = {}
    model_of: dict[NodeId, str] = {}
    calibration: CalibrationSettings | None = None
    proximity: ProximitySettings = ProximitySettings()
    peaks: PeakSettings = PeakSettings()

    def __post_init__(self) -> None:
        """Refuse a model of which there is no offset."""
        unknown = sorted({*self.model_of.values()} - self.model_offset_db.keys())
        if unknown:
            raise ValueError(f"model_of: no model_offset_db for {', '.join(unknown)}; give one")

    def offset_of_db(self, responder_id: NodeId) -> float:
        """Return what is added to a responder's readings, whatever is learnt."""
        model = self.model_of.get(responder_id)
        return self.offset_db + (0.0 if model is None else self.model_offset_db[model])

    def scale(self) -> Scale:
        """Return what brings readings to the product's scale, knowing of no installer yet."""
        offset_of_db = {each: self.offset_of_db(each) for each in self.model_of}
        return Scale(self.offset_db, offset_of_db, self.calibration)
