"""The score card of one run.

CE50 and CE95 are the radii that half and 95 % of the horizontal errors stay within (ISO/IEC 18305).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TypeAlias

import msgspec
import numpy as np
from numpy.typing import NDArray

from command_post.evaluation.errors import MethodErrors, RunErrors, TrackErrors
from shared.maths.statistics import circular_error

Floats: TypeAlias = NDArray[np.float64]


class Radii(msgspec.Struct, frozen=True):
    """Radii that half and 95 % of the errors stay within."""

    ce50_m: float
    ce95_m: float


class MethodScore(msgspec.Struct, frozen=True, kw_only=True):
    """One way of tracking, scored. ``None`` where there is nothing to score.

    ``team`` and ``pair`` (between responders) are taken after the one rotation of the whole team
    that fits the truth best, for nothing that is heard inside tells which way the map is turned;
    ``abs`` and ``pair_unturned`` are taken as it stands.
    ``end_m`` is the median responder's absolute error at the last truth, ``vertical_m`` the median
    absolute error in height.
    """

    absolute: Radii | None = msgspec.field(name="abs")
    pair: Radii | None
    pair_unturned: Radii | None
    team: Radii | None
    end_m: float | None
    vertical_m: float | None


class DapScore(msgspec.Struct, frozen=True, kw_only=True):
    """Errors of the DAPs that responders set down: over all, and of each by id."""

    ce50_m: float
    ce95_m: float
    each_m: dict[str, float]


class ResponderScore(msgspec.Struct, frozen=True, kw_only=True):
    """One responder's absolute errors, by dead reckoning alone and live; and the live coverage."""

    pdr: Radii | None
    live: Radii | None
    pdr_end_m: float | None
    live_end_m: float | None
    coverage95_pct: float | None


class Score(msgspec.Struct, frozen=True, kw_only=True):
    """The score card of one run.

    ``pdr`` is dead reckoning of each responder's increments from their start, ``live`` what the
    post said at the time, ``after`` what it made of everything afterwards. ``coverage95_pct`` is
    the share of the time in which the truth was inside the region that the post gave for 95 %.
    """

    pdr: MethodScore
    live: MethodScore
    after: MethodScore | None = None
    dap: DapScore | None
    coverage95_pct: float | None
    responders: dict[str, ResponderScore]


def score(errors: RunErrors) -> Score:
    """Return the score card of one run; what cannot be scored is ``None``."""
    ids = sorted(errors.pdr.responders | errors.live.responders)
    dap_m = errors.live.dap_m
    dap = radii([list(dap_m.values())])
    return Score(
        pdr=_method_score(errors.pdr),
        live=_method_score(errors.live),
        after=None if errors.after is None else _method_score(errors.after),
        dap=None if dap is None else DapScore(
            ce50_m=dap.ce50_m, ce95_m=dap.ce95_m, each_m=dict(sorted(dap_m.items()))
        ),
        coverage95_pct=coverage_pct(errors.live.responders.values()),
        responders={responder_id: _responder_score(responder_id, errors) for responder_id in ids},
    )  # fmt: skip


def radii(errors_m: Iterable[Sequence[float] | Floats]) -> Radii | None:
    """Return CE50 and CE95 of errors thrown together; ``None`` if there are none."""
    together = np.concatenate([np.empty(0), *map(np.asarray, errors_m)])
    return Radii(*circular_error(together)) if together.size else None


def coverage_pct(tracks: Iterable[TrackErrors]) -> float | None:
    """Return the share of all seconds at which the truth was inside the 95 % region."""
    inside = [track.inside for track in tracks if track.inside is not None]
    return 100.0 * float(np.concatenate(inside).mean()) if inside else None


def _method_score(errors: MethodErrors) -> MethodScore:
    tracks = errors.responders.values()
    return MethodScore(
        absolute=radii(track.absolute_m for track in tracks),
        pair=radii([errors.pair_m]),
        pair_unturned=radii([errors.pair_unturned_m]),
        team=radii(track.team_m for track in tracks),
        end_m=float(np.median([track.end_m for track in tracks])) if tracks else None,
        vertical_m=float(np.median(np.concatenate([track.vertical_m for track in tracks])))
        if tracks
        else None,
    )


def _responder_score(responder_id: str, errors: RunErrors) -> ResponderScore:
    pdr = errors.pdr.responders.get(responder_id)
    live = errors.live.responders.get(responder_id)
    return ResponderScore(
        pdr=radii([pdr.absolute_m]) if pdr else None,
        live=radii([live.absolute_m]) if live else None,
        pdr_end_m=pdr.end_m if pdr else None,
        live_end_m=live.end_m if live else None,
        coverage95_pct=coverage_pct([live]) if live else None,
    )
