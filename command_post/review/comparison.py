"""A recording fused once more, and how far that is from what the post told.

It is smoothed with all that is known by its end, or fused by another method or with other settings.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import msgspec
import numpy as np

from command_post.evaluation.evidence import Evidence, Track
from command_post.evaluation.track_difference import differences
from command_post.fusion.interface import Afterwards
from command_post.fusion.settings import FusionMethod, FusionSettings
from command_post.incident import Incident, IncidentSettings
from command_post.nodes.notice_log import log_faults
from command_post.plans.plan_file import with_plan
from command_post.replay import Sides, recorded_settings, replay
from command_post.review.wishes import Compared, Line, Sources, Wish
from shared.config import load_toml
from shared.mcap_reader import RecordingError
from shared.messages import NodeId

LEAST_S = 1.0
"""Moments of a line are so far apart at least."""


def other_settings(
    recorded: IncidentSettings,
    method: FusionMethod | None,
    file: Path | None,
    plan: Path | None,
) -> IncidentSettings:
    """Return how to fuse instead of as it was ``recorded``: see ``command-post replay``.

    Raises ``ConfigError`` for a ``file`` (TOML) or a ``plan`` (GeoJSON) that cannot be used.
    """
    fusion = recorded.fusion if file is None else load_toml(file, FusionSettings)
    if method is not None:
        fusion = msgspec.structs.replace(fusion, method=method)
    return msgspec.structs.replace(recorded, fusion=with_plan(fusion, plan))


def compare(
    sources: Sources, wish: Wish, watch: Callable[[int], None] = lambda _: None
) -> Compared:
    """Fuse a recording as it is wished, and compare; ``watch`` is told how far it is (log time).

    Raises ``RecordingError``, also where nothing comes of it, and ``ConfigError``.
    """
    settings = other_settings(
        recorded_settings(sources.recording),
        None if wish.way == "smoothed" else wish.way,
        sources.settings if wish.settings else None,
        sources.plan if wish.plan else None,
    )
    sides, incident = Sides(Evidence(), Evidence()), Incident(settings)
    replay(sources.recording, incident, sides, watch)
    found = incident.afterwards() if wish.way == "smoothed" else None
    log_faults(incident.take_notices())
    smoothed = {} if found is None else tracks_of(found)
    other = smoothed if wish.way == "smoothed" else sides.now.tracks("live")
    if not other:
        raise RecordingError(f"{sources.recording}: nobody's way comes of it so")
    told = sides.then.tracks("live")
    lines = {name: _line(track) for name, track in other.items()}
    return Compared(wish, lines, differences(told, other))


def tracks_of(found: Afterwards) -> dict[NodeId, Track]:
    """Return smoothed ways as tracks, by responder; who has none is not there."""
    return {
        name: Track(track.time_s, track.position_m, track.covariance_m2)
        for name, track in sorted(found.tracks.items())
        if track.time_s.size
    }


def _line(track: Track) -> Line:
    kept, last = [0], len(track.time_s) - 1
    for row, time_s in enumerate(track.time_s.tolist()):
        if time_s - track.time_s[kept[-1]] >= LEAST_S or row == last:
            kept.append(row)
    places_m = np.round(track.position_m[kept], 2).tolist()
    return Line(
        np.round(track.time_s[kept], 2).tolist(),
        [(north_m, east_m, down_m) for north_m, east_m, down_m in places_m],
    )
