"""What there is to export of a recording: where everybody was, and what happened."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterable, Iterator
from datetime import UTC, datetime
from typing import Literal, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from command_post.floors import Floor, floors_of
from command_post.fusion.dap_map import InstalledDap
from command_post.fusion.interface import Afterwards
from command_post.incident_settings import IncidentSettings
from command_post.review.past import Past
from command_post.review.timeline import Timeline, timeline_of
from shared.geodesy import Origin
from shared.messages import NodeId, TrackEstimate, TrackStatus
from shared.units import NS_PER_S

Floats: TypeAlias = NDArray[np.float64]
Kind: TypeAlias = Literal["live", "afterwards"]


class Stance(NamedTuple):
    """Where somebody was held to be at ``time_ns``: ``live``, or with all that is known by the end.

    Covariance is horizontal (nn, ne, ee in m²); what is not known of ``afterwards`` is ``None``.
    """

    kind: Kind
    responder_id: NodeId
    time_ns: int
    place_m: tuple[float, float, float]
    covariance_m2: tuple[float, float, float]
    floor_down_m: float
    down_sd_m: float | None = None
    heading_rad: float | None = None
    heading_sd_rad: float | None = None
    status: TrackStatus = "tracking"
    reason: str = ""


class Material(NamedTuple):
    """A recording, read for export. ``tracks`` are by responder and kind, in the order of time."""

    timeline: Timeline
    settings: IncidentSettings
    metadata: dict[str, str]
    tracks: dict[tuple[NodeId, Kind], list[Stance]]
    daps: dict[NodeId, InstalledDap]
    floors: list[Floor]

    @property
    def stances(self) -> list[Stance]:
        """All of all tracks, one track after another."""
        return [each for track in self.tracks.values() for each in track]

    def level(self, down_m: float) -> int:
        """Return the storey that a height is of."""
        return min(self.floors, key=lambda each: abs(each.down_m - down_m)).level

    def where(self, responder_id: NodeId, time_ns: int) -> Stance | None:
        """Return where somebody is held to have been at a time; ``None`` before they came."""
        track = self.tracks.get((responder_id, "live"), [])
        row = bisect_right(track, time_ns, key=lambda each: each.time_ns) - 1
        return None if row < 0 else track[row]


def material_of(past: Past, afterwards: Afterwards | None = None) -> Material:
    """Return what there is to export; all is read for it. ``afterwards``: smoothed ways as well."""
    live = [_stance(track) for track in past.estimates()]
    stances = live if afterwards is None else [*live, *_smoothed(afterwards)]
    # What is told of a moment again is better known; and what is told of it last is kept.
    newest = {(each.responder_id, each.kind, each.time_ns): each for each in stances}
    tracks: dict[tuple[NodeId, Kind], list[Stance]] = {}
    for each in sorted(newest.values(), key=lambda each: (each[1], each[0], each[2])):
        tracks.setdefault((each.responder_id, each.kind), []).append(each)
    standing = past.course.at(past.end_ns)
    return Material(
        timeline=timeline_of(past),
        settings=past.settings,
        metadata=dict(past.recording.metadata),
        tracks=tracks,
        daps=dict(sorted(standing.daps.items())),
        floors=floors_of(each.floor_down_m for each in live),
    )


def geodetic(stances: Iterable[Stance], origin: Origin) -> Floats:
    """Return where on the Earth stances (n) are: (n, 3: latitude, longitude, height)."""
    places_m = np.array([each.place_m for each in stances], np.float64).reshape(-1, 3)
    return origin.all_geodetic(places_m)


def iso(time_ns: int) -> str:
    """Return a time in UTC, to the millisecond, as ISO 8601 has it."""
    seconds, rest_ns = divmod(time_ns, NS_PER_S)
    moment = datetime.fromtimestamp(seconds, UTC)
    return f"{moment:%Y-%m-%dT%H:%M:%S}.{rest_ns // 1_000_000:03d}Z"


def _stance(track: TrackEstimate) -> Stance:
    return Stance(
        "live",
        track.responder_id,
        track.event_time_ns,
        (track.north_m, track.east_m, track.down_m),
        track.covariance_m2,
        track.floors[0].down_m if track.floors else track.down_m,
        track.down_sd_m,
        track.heading_rad,
        track.heading_sd_rad,
        track.status,
        track.reason,
    )


def _smoothed(afterwards: Afterwards) -> Iterator[Stance]:
    for name, track in afterwards.tracks.items():
        rows = zip(
            track.time_s.tolist(), track.position_m.tolist(), track.covariance_m2.tolist(),
            strict=True,
        )  # fmt: skip
        for time_s, (north_m, east_m, down_m), (nn, ne, ee) in rows:
            time_ns = round(time_s * NS_PER_S)
            place_m = (north_m, east_m, down_m)
            yield Stance("afterwards", name, time_ns, place_m, (nn, ne, ee), down_m)
