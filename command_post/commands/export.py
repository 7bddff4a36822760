"""``command-post export``: a recording for other programs, and a report of it for people."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import structlog

from command_post.commands.afterwards import smoothed
from command_post.exports.endings import FORMATS
from command_post.exports.formats import exported
from command_post.exports.material import material_of
from command_post.review.past import Past
from shared.config import ConfigError
from shared.files import check_can_write, replace_atomically
from shared.geodesy import Origin, parse_origin
from shared.mcap_index import IndexedRecording
from shared.mcap_reader import RecordingError
from shared.process import ExitCode
from shared.recording_parts import parts_of

_log = structlog.stdlib.get_logger(__name__)


def export(
    file: Path,
    *,
    output: list[Path],
    origin: str | None = None,
    afterwards: bool = False,
) -> int:
    """Write what a recording shows: tracks, alerts, orders, or a report of it all.

    The name's ending says how: .csv (tracks), .geojson and .kml (tracks, alerts, access points),
    .html (a report to be printed). Example: command-post export incident.mcap --output report.html

    Parameters
    ----------
    file
        A recording: .mcap, or the .mcap.part that a killed post leaves; of several parts the
        first, or their folder.
    output
        What to write; may be given several times. A file that is there is replaced.
    origin
        Where the incident's origin is: LATITUDE,LONGITUDE[,HEIGHT[,BEARING]], as of 'run'; by
        default as the recording has it.
    afterwards
        Also tell everybody's way as it is smoothed with all that is known by the end.

    """
    try:
        given = _checked(output, origin)
        found = smoothed(file) if afterwards else None
        with IndexedRecording([part.path for part in parts_of(file)]) as recording:
            past = Past(recording)
            place = given or past.origin()
            material = material_of(past, found)
        made = [(path, exported(path.suffix, material, file, place)) for path in output]
        for path, content in made:
            _write(path, content)
    except (RecordingError, ConfigError, ValueError) as error:
        _log.error(str(error))
        return ExitCode.USAGE
    except OSError as error:
        _log.error(str(error))
        return ExitCode.FAILURE
    if material.timeline.faults:
        _log.warning(f"{file}: not whole", why=material.timeline.faults)
    return ExitCode.OK


def _write(path: Path, content: bytes) -> None:
    """Write a file in one go. Raises ``OSError``, which names it and not what it is at first."""
    try:
        with replace_atomically(path) as written:
            written.write(content)
    except OSError as error:
        raise OSError(f"{path}: cannot be written ({error.strerror})") from error


def _checked(output: Sequence[Path], origin: str | None) -> Origin | None:
    """Return where the incident is; ``ValueError`` for what cannot be done, before it is begun."""
    place = None if origin is None else parse_origin(origin)
    for path in output:
        if path.suffix not in FORMATS:
            raise ValueError(f"--output {path}: let it end with {', '.join(FORMATS)}")
        check_can_write(path, "--output")
    return place
