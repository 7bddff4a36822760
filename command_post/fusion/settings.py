"""What the fusion can be told, with the defaults it is tuned to."""

from __future__ import annotations

import math
from typing import Annotated, Literal, TypeAlias

import msgspec
from msgspec import Meta

from command_post.fusion.motion_model import MotionModel
from command_post.fusion.proximity_model import ProximityModel
from command_post.fusion.resampling import Scheme
from command_post.fusion.team.settings import TeamSettings

FusionMethod: TypeAlias = Literal["team", "published"]

HOLD_S: dict[FusionMethod, float] = {"team": 0.1, "published": 1.5}
"""How long an event is to wait for earlier ones, in seconds.

The published filter takes what comes later as if it had happened just now; the team's fusion puts
it where it belongs, and only has to begin again less often if it waits for the network.
"""


class FusionSettings(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """How responders are tracked: ``method``, and the parameters of each.

    Those of ``team`` stand by themselves; the others are the published filter's. ``seed`` begins
    every responder's random numbers and ``particles`` is each one's number of particles.
    ``start_drift_sd_rad`` spreads δφ at the start. The cloud is resampled by ``scheme`` when its
    effective count falls below ``resample_below`` × ``particles``; 1 is at every measurement. Who
    starts without saying where is put at the incident's origin, give or take ``entrance_sd_m``
    each way; who is heard without a start, ``unknown_start_sd_m`` each way and heading anywhere.
    """

    method: FusionMethod = "team"
    team: TeamSettings = TeamSettings()
    seed: Annotated[int, Meta(ge=0, le=2**63 - 1)] = 1
    particles: Annotated[int, Meta(ge=10, le=1_000_000)] = 1000
    start_drift_sd_rad: Annotated[float, Meta(ge=0.0, le=math.pi)] = math.radians(1.0)
    scheme: Scheme = "systematic"
    resample_below: Annotated[float, Meta(gt=0.0, le=1.0)] = 0.5
    entrance_sd_m: Annotated[float, Meta(gt=0.0, le=1e4)] = 1.0
    unknown_start_sd_m: Annotated[float, Meta(gt=0.0, le=1e4)] = 30.0
    motion: MotionModel = MotionModel()
    proximity: ProximityModel = ProximityModel()
