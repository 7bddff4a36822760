"""How wrong a unit's strides are, told as such: for exercises in which no sensor is simulated.

Settings give the spread over people and units; the fusion that has to live with it is told none
of them.
"""

from __future__ import annotations

from typing import Annotated, Literal, TypeAlias

import msgspec
from msgspec import Meta

Spread: TypeAlias = Annotated[float, Meta(ge=0.0, le=1e3)]
Share: TypeAlias = Annotated[float, Meta(ge=0.0, le=1.0)]
Degrees: TypeAlias = Annotated[float, Meta(ge=0.0, le=180.0)]


OdometrySource: TypeAlias = Literal["imu", "strides"]
"""Whether a rehearsal simulates the boots' sensors, or strides with their errors alone."""


class OdometrySettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Errors of strides, standard deviations, and what units say of them.

    ``source`` is what a rehearsal simulates unless it is told otherwise.
    ``scale`` is a person's, for all of their strides. The heading drifts by ``rate_bias_deg_s``,
    which wanders by ``rate_walk_deg_s`` in a second; each stride adds ``heading_deg``, and one in
    ``strides_a_jump`` one of ``jump_deg``. A stride is off by ``place_m`` + ``place_per_m`` × its
    length north and east, and ``height_m`` down; heights drift by ``climb_bias_m`` a stride. A
    share of ``missed`` goes unnoticed, with a jump of the heading. Starts are off by
    ``start_m`` each way.

    ``told_*`` is what units publish as standard deviations of a stride.
    """

    source: OdometrySource = "imu"
    scale: Spread = 0.02
    rate_bias_deg_s: Spread = 0.05
    rate_walk_deg_s: Spread = 0.004
    heading_deg: Degrees = 0.5
    strides_a_jump: Annotated[float, Meta(ge=1.0, le=1e9)] = 75.0
    jump_deg: Degrees = 6.0
    missed: Share = 0.004
    place_m: Spread = 0.03
    place_per_m: Spread = 0.02
    height_m: Spread = 0.015
    climb_bias_m: Spread = 0.002
    start_m: Spread = 0.3
    told_heading_deg: Degrees = 0.35
    told_place_m: Spread = 0.02
    told_place_per_m: Spread = 0.02
    told_height_m: Spread = 0.02
