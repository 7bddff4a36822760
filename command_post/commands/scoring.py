"""``command-post replay`` and ``command-post score``: what a recording shows."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from pathlib import Path

import msgspec
import structlog
from rich.console import Console

from command_post.evaluation.errors import measure
from command_post.evaluation.evidence import Evidence
from command_post.evaluation.score_card import Score, score
from command_post.evaluation.track_difference import TrackDifference, differences
from command_post.fusion.settings import FusionMethod
from command_post.incident import Incident
from command_post.nodes.notice_log import log_faults
from command_post.rehearsing.score_table import score_table
from command_post.replay import ReplayReport, Sides, recorded_settings
from command_post.replay import replay as replay_recording
from command_post.review.comparison import other_settings
from shared.config import ConfigError
from shared.files import check_can_write
from shared.mcap_reader import RecordingError, read_recording
from shared.process import ExitCode
from shared.simulation.plan import Plan, load_plan

_log = structlog.stdlib.get_logger(__name__)


def replay(
    file: Path,
    *,
    fusion: FusionMethod | None = None,
    settings: Path | None = None,
    plan: Path | None = None,
    json: bool = False,
) -> int:
    """Handle a recording once more, and compare what comes of it with what came of it then.

    Exits with 0 when every message is equal to the bit, with 1 when not, with 2 when the file
    cannot be replayed. With another fusion or other settings, it tells how far each responder's
    track then is from the recorded one. Example: command-post replay recordings/four_daps.mcap

    Parameters
    ----------
    file
        A recording: .mcap, or the .mcap.part that a killed post leaves.
    fusion
        Fuse by this method instead: team or published.
    settings
        Fuse with the settings in this TOML file instead of the recorded ones.
    plan
        The building's walls, in GeoJSON, instead of what was known of them.
    json
        Print the report as one JSON object.

    """
    sides = Sides(Evidence(), Evidence())
    try:
        told_settings = other_settings(recorded_settings(file), fusion, settings, plan)
        incident = Incident(told_settings)
        report = replay_recording(file, incident, sides)
        log_faults(incident.take_notices())
    except (RecordingError, ConfigError) as error:
        _log.error(str(error))
        return ExitCode.USAGE
    apart = differences(sides.then.tracks("live"), sides.now.tracks("live"))
    if json:
        _print_json(_as_json(report, apart))
    else:
        _print_report(report, apart)
    return ExitCode.OK if report.identical else ExitCode.FAILURE


def _as_json(report: ReplayReport, apart: Mapping[str, TrackDifference]) -> dict[str, object]:
    return {
        "handled": report.handled,
        "equal": report.equal,
        "different": report.different,
        "missing": report.missing,
        "extra": report.extra,
        "unconfirmed": report.unconfirmed,
        "identical": report.identical,
        "recording_complete": report.reading.complete,
        "tracks": apart,
    }


def _print_report(report: ReplayReport, apart: Mapping[str, TrackDifference]) -> None:
    """Print what a replay found; of tracks that are others, how far they are ``apart``."""
    Console().print(str(report), markup=False, highlight=False)
    for name, each in ({} if report.identical else apart).items():
        Console().print(
            f"{name}: {each.median_m:.2f} m from the recorded track in the median, "
            f"{each.p95_m:.2f} m at 95 %, {each.most_m:.2f} m at most",
            highlight=False,
        )


def score_file(
    file: Path,
    *,
    json: bool = False,
    picture: Path | None = None,
    plan: str | None = None,
) -> int:
    """Score a recording against the truth in it: dead reckoning alone beside the fused tracks.

    Example: command-post score recordings/four_daps.mcap --picture tracks.png

    Parameters
    ----------
    file
        A recording that has the truth in it.
    json
        Print the score as one JSON object.
    picture
        Draw the tracks into this PNG.
    plan
        The building under the tracks: a packaged plan's name or a TOML file.

    """
    try:
        check_can_write(picture, "--picture")
        building = load_plan(plan) if plan is not None else None
        evidence = read_evidence(file)
    except (RecordingError, ValueError) as error:
        _log.error(str(error))
        return ExitCode.USAGE
    told = score(measure(evidence))
    if told.live.absolute is None and told.pdr.absolute is None:
        _log.error(f"{file}: nothing to score: no track with a truth beside it")
        return ExitCode.FAILURE
    try:
        show_score(told, evidence, building, picture=picture, json=json)
    except OSError as error:
        _log.error(f"{picture}: cannot be written ({error.strerror})")
        return ExitCode.FAILURE
    return ExitCode.OK


def read_evidence(file: Path) -> Evidence:
    """Return what a recording holds to be scored. Raises ``RecordingError``."""
    evidence = Evidence()
    recording = read_recording(file)
    for recorded in recording:
        # What is heard as from a post was not made of what is recorded.
        if recorded.outgoing or "/post/" not in recorded.key:
            evidence.add_wire(recorded.key, recorded.payload)
    if not recording.report.complete:
        _log.warning(f"{file}: not whole", report=str(recording.report))
    return evidence


def show_score(
    told: Score, evidence: Evidence, plan: Plan | None, *, picture: Path | None, json: bool
) -> None:
    """Print a score card, and draw its tracks where there is to be a picture."""
    if picture is not None:
        # A demo that is broken off, or a score without a picture, need not wait for it.
        from command_post.rehearsing.picture import draw_tracks  # noqa: PLC0415

        draw_tracks(evidence, plan, picture)
    if json:
        _print_json(told)
    else:
        Console().print(score_table(told))


def _print_json(told: object) -> None:
    sys.stdout.buffer.write(msgspec.json.format(msgspec.json.encode(told)) + b"\n")
    sys.stdout.buffer.flush()
