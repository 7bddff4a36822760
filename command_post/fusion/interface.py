"""What every way of fusing does: events in, in about the order of their time; estimates out."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from typing import NamedTuple, Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray

from command_post.fusion.dap_map import InstalledDap
from command_post.fusion.mishaps import Mishap
from command_post.fusion.track import Estimate
from shared.messages import (
    Contact,
    DapInstallation,
    HeightFix,
    OdometryIncrement,
    PositionFix,
    ProximityEvent,
    RssiPeak,
    TrackStart,
)
from shared.topics import Role

Floats: TypeAlias = NDArray[np.float64]


class SmoothedTrack(NamedTuple):
    """A responder's way as it is held to have been, all evidence used: at times (n,) in seconds.

    ``position_m`` (n, 3) is north, east, down; ``covariance_m2`` (n, 3) nn, ne, ee.
    """

    time_s: Floats
    position_m: Floats
    covariance_m2: Floats


class Afterwards(NamedTuple):
    """All ways, and where the DAPs are held to stand, once everything is known."""

    tracks: Mapping[str, SmoothedTrack]
    daps: Mapping[str, InstalledDap]


class Changes(NamedTuple):
    """Estimates and DAPs that an event has changed, by id, and what went wrong with it."""

    estimates: list[tuple[str, Estimate]]
    daps: list[tuple[str, InstalledDap]]
    mishaps: list[Mishap]


class WayTold(NamedTuple):
    """Where a responder was told to be, and how their unit was turned then (rad).

    ``is_loose`` doubts the unit's scale.
    """

    told: Estimate
    turn_rad: float
    is_loose: bool


class Doubt(NamedTuple):
    """What is held to be wrong with a node since a time, in words, and how certain that is."""

    kind: str
    role: Role
    node_id: str
    since_ns: int
    words: str
    certainty: float


class Fusion(Protocol):
    """Tracks of all responders on one map. What an event changes, ``take_changes`` tells."""

    counts: Counter[str]

    @property
    def estimates(self) -> Mapping[str, Estimate]:
        """The newest estimate of every responder, by id."""

    @property
    def daps(self) -> Mapping[str, InstalledDap]:
        """The DAPs that stand, by id."""

    @property
    def doubts(self) -> tuple[Doubt, ...]:
        """What is held to be wrong with nodes now; the same tuple until that changes."""

    def start(self, responder_id: str, start: TrackStart) -> None:
        """A responder's unit begins."""

    def move(self, responder_id: str, increment: OdometryIncrement) -> None:
        """A responder moved."""

    def near(self, dap_id: str, event: ProximityEvent) -> None:
        """A DAP holds a responder to be near."""

    def peak(self, dap_id: str, event: RssiPeak) -> None:
        """A responder passed a DAP."""

    def contact(self, responder_id: str, event: Contact) -> None:
        """Two responders met."""

    def fix(self, event: PositionFix) -> None:
        """Somebody says where a responder is."""

    def height_fix(self, event: HeightFix) -> None:
        """Somebody says how high a responder or a DAP is."""

    def install(self, dap_id: str, said: DapInstallation) -> None:
        """A DAP was set down."""

    def heard(self, responder_id: str, time_ns: int, beat_s: float | None = None) -> None:
        """A responder's unit has told all that they moved until then; it does so every ``beat_s``.

        ``None`` of one that tells nothing while its wearer stands.
        """

    @property
    def silent_due_ns(self) -> int | None:
        """When ``pass_time`` may have something to tell; ``None`` if not before more is heard."""

    def pass_time(self, time_ns: int) -> list[tuple[str, Estimate]]:
        """Tell in turn of who should have been heard by ``time_ns``, up to which all is fused."""

    def forget(self, before_ns: int) -> None:
        """Nothing comes any more that happened before ``before_ns``: drop what is of no use now."""

    def begin_from(self, ways: Mapping[str, WayTold], daps: Mapping[str, InstalledDap]) -> bool:
        """Begin where everybody was told to be; ``False`` if the method cannot."""

    def take_changes(self) -> Changes:
        """Return what has changed since this was last asked, in the order of the ids."""

    def afterwards(self) -> Afterwards | None:
        """Return everybody's way with all that is known; ``None`` if the method has no such."""
