"""Where the command post holds everybody and every DAP to be."""

from __future__ import annotations

from typing import Annotated

import msgspec
from msgspec import Meta

from shared.messages.values import (
    Angle,
    Coordinate,
    Covariance,
    LocalPosition,
    Message,
    NodeId,
    Outline,
    Probability,
    StandardDeviation,
    TimeNs,
    TrackStatus,
)


class FloorShare(msgspec.Struct, frozen=True, gc=False):
    """How probable it is that somebody is on the floor at the height ``down_m``."""

    down_m: Coordinate
    probability: Probability


class TrackEstimate(Message, frozen=True, kw_only=True):
    """Where the command post holds a responder to be at ``event_time_ns``.

    ``covariance_m2`` is horizontal (nn, ne, ee), ``down_sd_m`` of the height. ``heading_rad`` is
    the heading in the incident's frame. ``last_proximity_time_ns`` is when a DAP last tied the
    track down, if one has. Where one ellipse does not tell it, ``regions_m`` are the outlines
    (north, east) that hold 95 % together. ``floors`` are the likely ones, likeliest first.
    ``status`` is ``reason``ed in words where it is not ``tracking``.
    """

    responder_id: NodeId
    north_m: Coordinate
    east_m: Coordinate
    down_m: Coordinate
    covariance_m2: tuple[Covariance, Covariance, Covariance]
    heading_rad: Angle
    heading_sd_rad: StandardDeviation
    last_proximity_time_ns: TimeNs | None
    down_sd_m: StandardDeviation | None = None
    regions_m: Annotated[tuple[Outline, ...], Meta(max_length=8)] = ()
    floors: Annotated[tuple[FloorShare, ...], Meta(max_length=8)] = ()
    status: TrackStatus = "tracking"
    reason: Annotated[str, Meta(max_length=200)] = ""


class DapEstimate(Message, frozen=True, kw_only=True):
    """Where the command post holds a DAP to stand, since its installation at ``event_time_ns``."""

    dap_id: NodeId
    position: LocalPosition
