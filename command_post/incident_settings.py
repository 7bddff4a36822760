"""Whose incident it is, and how it is fused: a recording carries it, so that it can be replayed."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import msgspec

from command_post.fusion.settings import HOLD_S, FusionSettings
from command_post.fusion.time_line import TimeLineSettings
from command_post.nodes.teams import Teams
from shared.messages import NodeId
from shared.units import NS_PER_S

_GONE = ("near_sd_m",)
"""Settings of the team's fusion that older recordings carry, and that never had any effect."""


class IncidentSettings(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Whose incident it is, and how its events are ordered and fused."""

    incident: NodeId = "exercise"
    post_id: NodeId = "post"
    time_line: TimeLineSettings = TimeLineSettings()
    fusion: FusionSettings = FusionSettings()
    teams: Teams = Teams()

    @property
    def hold_ns(self) -> int:
        """How long an event waits for earlier ones."""
        hold_s = self.time_line.hold_s
        return round((HOLD_S[self.fusion.method] if hold_s is None else hold_s) * NS_PER_S)

    def as_metadata(self) -> dict[str, str]:
        """Return them as a recording carries them."""
        return {"incident_settings": msgspec.json.encode(self).decode()}

    @classmethod
    def from_metadata(cls, metadata: Mapping[str, str]) -> IncidentSettings:
        """Return the settings a recording was made with; ``ValueError`` if it does not say."""
        try:
            told = msgspec.json.decode(metadata["incident_settings"])
            return msgspec.convert(_without_gone(told), type=cls)
        except KeyError:
            raise ValueError("does not say its settings; give one that a post made") from None
        except msgspec.MsgspecError as error:
            raise ValueError(f"its settings cannot be used: {error}") from error


def _without_gone(told: Any) -> Any:
    match told:
        case {"fusion": {"team": dict(team)}}:
            for name in _GONE:
                team.pop(name, None)
    return told
