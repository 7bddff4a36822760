"""How far two ways of fusing the same evidence are apart, responder by responder (pure)."""

from __future__ import annotations

import math

import msgspec
import numpy as np

from command_post.evaluation.evidence import Track


class TrackDifference(msgspec.Struct, frozen=True, kw_only=True):
    """Horizontal distance of one responder's two tracks at whole seconds, in metres.

    ``first_s`` and ``most_s`` are when they are first over a metre apart (``None``: never), and
    when furthest, in seconds since the epoch.
    """

    median_m: float
    p95_m: float
    most_m: float
    most_s: float
    first_s: float | None


APART_M = 1.0


def difference(one: Track, other: Track) -> TrackDifference | None:
    """Compare two tracks over the time that both cover; ``None`` if there is none."""
    first_s = math.ceil(max(one.time_s[0], other.time_s[0]))
    last_s = math.floor(min(one.time_s[-1], other.time_s[-1]))
    seconds = np.arange(first_s, last_s + 1.0)
    if not seconds.size:
        return None
    apart_m = np.hypot(*(one.at(seconds).position_m - other.at(seconds).position_m)[:, :2].T)
    over = np.flatnonzero(apart_m > APART_M)
    furthest = int(np.argmax(apart_m))
    return TrackDifference(
        median_m=float(np.median(apart_m)),
        p95_m=float(np.percentile(apart_m, 95.0)),
        most_m=float(apart_m[furthest]),
        most_s=float(seconds[furthest]),
        first_s=float(seconds[over[0]]) if over.size else None,
    )


def differences(one: dict[str, Track], other: dict[str, Track]) -> dict[str, TrackDifference]:
    """Compare the tracks of all responders that have both."""
    return {
        name: found
        for name in sorted(one.keys() & other.keys())
        if (found := difference(one[name], other[name])) is not None
    }
