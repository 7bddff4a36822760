"""``command-post afterwards``: a recording smoothed with all that is known by its end."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Literal

import msgspec
import numpy as np
import structlog
from rich.console import Console
from rich.table import Table

from command_post.evaluation.evidence import Evidence
from command_post.evaluation.track_difference import TrackDifference, differences
from command_post.fusion.interface import Afterwards, SmoothedTrack
from command_post.fusion.track_map import TrackMap, map_of
from command_post.incident import Incident
from command_post.nodes.notice_log import log_faults
from command_post.plans.plan_file import with_plan
from command_post.replay import Sides, recorded_settings, replay
from command_post.review.comparison import tracks_of
from shared.files import check_can_write, replace_atomically
from shared.mcap_reader import RecordingError
from shared.messages import LocalPosition
from shared.process import ExitCode

_log = structlog.stdlib.get_logger(__name__)


class SmoothedStance(msgspec.Struct, frozen=True):
    """A moment of a way: seconds since the epoch, place (m), covariance (nn, ne, ee in m²)."""

    time_s: float
    north_m: float
    east_m: float
    down_m: float
    covariance_m2: tuple[float, float, float]


class AfterAction(msgspec.Struct, frozen=True, kw_only=True):
    """What is held to have happened, for other programs to read."""

    kind: Literal["clew-after-action"] = "clew-after-action"
    tracks: dict[str, list[SmoothedStance]]
    daps: dict[str, LocalPosition]
    track_map: TrackMap
    from_live: dict[str, TrackDifference] = {}
    """How far each way is from what the post told meanwhile."""


def afterwards(
    file: Path, *, output: Path | None = None, plan: Path | None = None, json: bool = False
) -> int:
    """Smooth a recording with all that is known by its end; make the map of the ways walked.

    Example: command-post afterwards recordings/four_daps.mcap --output after.json

    Parameters
    ----------
    file
        A recording: .mcap, or the .mcap.part that a killed post leaves.
    output
        Write every way with its covariances, the DAPs and the walked graph into this JSON file.
    plan
        The building's walls, in GeoJSON, instead of what was known of them.
    json
        Print the same instead of a table.

    """
    sides = Sides(Evidence(), Evidence())
    try:
        check_can_write(output, "--output")
        found = smoothed(file, plan, sides)
    except (RecordingError, ValueError) as error:
        _log.error(str(error))
        return ExitCode.USAGE
    if found is None or not found.tracks:
        _log.error(f"{file}: nobody's way is in it, or it was fused by a method that smooths none")
        return ExitCode.FAILURE
    apart = differences(sides.then.tracks("live"), tracks_of(found))
    told = msgspec.structs.replace(after_action(found), from_live=apart)
    encoded = msgspec.json.format(msgspec.json.encode(told), indent=1) + b"\n"
    if output is not None:
        try:
            with replace_atomically(output) as file_now:
                file_now.write(encoded)
        except OSError as error:
            _log.error(f"{output}: cannot be written ({error.strerror})")
            return ExitCode.FAILURE
    if json:
        sys.stdout.buffer.write(encoded)
        sys.stdout.buffer.flush()
    else:
        Console().print(_table(found, told))
    return ExitCode.OK


def smoothed(file: Path, plan: Path | None = None, sides: Sides | None = None) -> Afterwards | None:
    """Return what a recording comes to with all that is in it, and with a plan, if one is given.

    ``sides`` take in what the post told, then and now. Raises ``RecordingError``, and
    ``ConfigError`` for the plan.
    """
    settings = recorded_settings(file)
    fusion = with_plan(settings.fusion, plan)
    incident = Incident(msgspec.structs.replace(settings, fusion=fusion))
    replay(file, incident, sides)
    found = incident.afterwards()
    log_faults(incident.take_notices())
    return found


def after_action(found: Afterwards) -> AfterAction:
    """Return it as other programs read it."""
    return AfterAction(
        tracks={name: _stances(track) for name, track in sorted(found.tracks.items())},
        daps={name: dap.position for name, dap in sorted(found.daps.items())},
        track_map=map_of(found.tracks),
    )


def _stances(track: SmoothedTrack) -> list[SmoothedStance]:
    rows = zip(
        track.time_s.tolist(), track.position_m.tolist(), track.covariance_m2.tolist(), strict=True
    )
    return [
        SmoothedStance(time_s, north_m, east_m, down_m, (nn, ne, ee))
        for time_s, (north_m, east_m, down_m), (nn, ne, ee) in rows
    ]


def _table(found: Afterwards, told: AfterAction) -> Table:
    columns = ("Responder", "walked", "climbed", "give or take, median", "from the live track")
    table = Table(*columns, title="Afterwards")
    for name, track in sorted(found.tracks.items()):
        step_m = np.diff(track.position_m, axis=0)
        walked_m = float(np.hypot(step_m[:, 0], step_m[:, 1]).sum())
        climbed_m = float(np.maximum(-step_m[:, 2], 0.0).sum())
        spread_m = float(np.sqrt(np.median(track.covariance_m2[:, [0, 2]].mean(axis=1))))
        apart = told.from_live.get(name)
        off = "" if apart is None else f"{apart.median_m:.2f} m, at most {apart.most_m:.2f} m"
        table.add_row(name, f"{walked_m:.0f} m", f"{climbed_m:.1f} m", f"{spread_m:.2f} m", off)
    walked = told.track_map
    kinds = [node.kind for node in walked.nodes]
    length_m = sum(edge.length_m for edge in walked.edges)
    table.caption = (
        f"{len(found.daps)} DAPs; the map: {length_m:.0f} m of ways between {len(kinds)} places, "
        f"{kinds.count('stairs')} on stairs, {kinds.count('room')} in rooms"
    )
    return table
