"""What a recording can be compared with, and what comes of that."""

from __future__ import annotations

from pathlib import Path
from typing import Literal, TypeAlias

import msgspec

from command_post.evaluation.track_difference import TrackDifference
from shared.messages import NodeId, Vector3

Way: TypeAlias = Literal["smoothed", "team", "published"]
"""Smoothed as it was fused, or fused anew by a method."""


class Wish(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What to compare with: the files' own ``plan`` and ``settings`` are used where wished for."""

    way: Way
    plan: bool = False
    settings: bool = False


class Sources(msgspec.Struct, frozen=True):
    """What there is to compare with: a recording, a plan and other settings, if there are any."""

    recording: Path
    plan: Path | None = None
    settings: Path | None = None


class Line(msgspec.Struct, frozen=True):
    """A way: seconds since the epoch, and places (north, east, down)."""

    times_s: list[float]
    places_m: list[Vector3]


class Compared(msgspec.Struct, frozen=True):
    """The other ways, and how far they are from those that the post told."""

    wish: Wish
    lines: dict[NodeId, Line]
    differences: dict[NodeId, TrackDifference]
