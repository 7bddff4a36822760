"""``command-post verify`` and ``command-post salvage``: what is left of a recording."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import msgspec
import structlog
from cyclopts import Parameter
from rich.console import Console

from command_post.recorder.file import RecorderError
from command_post.recorder.mirror import Mirror
from command_post.recorder.salvage import salvage
from command_post.recorder.verification import Verification, verify_recording
from shared.geodesy import parse_origin
from shared.mcap_reader import RecordingError
from shared.process import ExitCode

_log = structlog.stdlib.get_logger(__name__)


def verify(file: Path, *, json: Annotated[bool, Parameter(negative="")] = False) -> int:
    """Say what a recording holds, and whether it is all there: counts, gaps, order, hashes.

    Exits with 0 if nothing is missing, repeated or out of order, with 1 if something is, with 2 if
    the file is no recording. Example: command-post verify recordings/four_daps.mcap

    Parameters
    ----------
    file
        A recording: .mcap, or the .mcap.part that a killed post leaves; of several parts the
        first, or their folder.
    json
        Print it as one JSON object.

    """
    try:
        told = verify_recording(file)
    except (RecordingError, OSError) as error:
        _log.error(str(error))
        return ExitCode.USAGE
    text = msgspec.json.format(msgspec.json.encode(told)).decode() if json else _in_words(told)
    Console().print(text, markup=False, highlight=False, soft_wrap=True)
    return ExitCode.OK if told.whole else ExitCode.FAILURE


def salvage_file(file: Path, *, output: Path, origin: str | None = None) -> int:
    """Make a whole recording of one that was broken off or damaged; that one stays as it is.

    What is to be looked at in Foxglove is drawn anew, also of a recording that is whole and has
    none of it. Example: command-post salvage incident.mcap.part --output salvaged.mcap

    Parameters
    ----------
    file
        The recording, as it was found: its first file, or the folder of its parts.
    output
        The new one; its name must be free.
    origin
        Where it was, for the map: LATITUDE,LONGITUDE[,HEIGHT[,BEARING]].

    """
    try:
        place = None if origin is None else parse_origin(origin)
        report = salvage(file, output, Mirror(place))
    except (ValueError, RecorderError) as error:
        _log.error(str(error))
        return ExitCode.USAGE
    Console().print(f"{report}\n{output}: written", markup=False, highlight=False)
    return ExitCode.OK


def _in_words(told: Verification) -> str:
    counts = [f"  {count:>9} {topic}" for topic, count in told.received.items()]
    made = [f"  {count:>9} {topic}" for topic, count in told.made.items()]
    journals = [
        f"  {each.role} {each.node_id}: {each.last_number} numbered, {each.missing} missing"
        for each in told.journals
    ]
    faults = [
        f"{told.repeated} messages of journals repeated" if told.repeated else "",
        f"{told.unreadable_keys} messages under keys that are not ours"
        if told.unreadable_keys else "",
        *(
            f"{each.name} does not follow the file before it, or that was changed"
            for each in told.files if not each.follows
        ),
        *(f"the post's clock was set back by {each:.3f} s" for each in told.set_back_s),
    ]  # fmt: skip
    lines = [
        told.reading, "received:", *counts, "made of it:", *made,
        *(["journals:", *journals] if journals else []), *(each for each in faults if each),
        f"messages sha256 {told.messages_sha256}",
        *(f"file sha256     {each.sha256} {each.name}" for each in told.files),
        "whole" if told.whole else "NOT WHOLE",
    ]  # fmt: skip
    return "\n".join(lines)
