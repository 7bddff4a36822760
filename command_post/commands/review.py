"""``command-post review``: a recording in the page, to be played and gone through."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import structlog
from cyclopts import Parameter

from command_post.listening import Address, listening_address
from command_post.plans.plan_images import load_plan
from command_post.review.background import Background
from command_post.review.past import Past
from command_post.review.wishes import Sources
from command_post.web.review_app import Exhibit, make_review_app
from command_post.web.serving import served
from shared.geodesy import parse_origin
from shared.mcap_index import IndexedRecording
from shared.mcap_reader import RecordingError
from shared.process import ExitCode, stop_on_signals
from shared.recording_parts import parts_of

_log = structlog.stdlib.get_logger(__name__)


def review(
    file: Path,
    *,
    page: str = "127.0.0.1:8080",
    origin: str | None = None,
    plan: Path | None = None,
    plan_image: Annotated[tuple[str, ...], Parameter(consume_multiple=False)] = (),
    settings: Path | None = None,
) -> int:
    """Show a recording in the commander's page, as it was at any moment, until SIGINT or SIGTERM.

    Nothing in it can be ordered or dealt with. Example: command-post review incident.mcap

    Parameters
    ----------
    file
        A recording: .mcap, or the .mcap.part that a killed post leaves; of several parts the
        first, or their folder.
    page
        HOST:PORT of this machine where a browser finds it.
    origin
        Where the incident's origin is, as of 'run', for exports as GeoJSON and KML; as it was last
        said in the recording, if not given.
    plan
        The building's walls, in GeoJSON, to draw and to compare with.
    plan_image
        A storey's plan (PNG) to draw, as of 'run'; may be given several times.
    settings
        Settings of the fusion (TOML) to compare with.

    """
    try:
        address = _address(page)
        place = None if origin is None else parse_origin(origin)
        drawn = load_plan(plan, plan_image)
        sources = _checked(Sources(file, plan, settings))
        parts = [part.path for part in parts_of(file)]
        with stop_on_signals() as stop, IndexedRecording(parts) as recording:
            past = Past(recording)
            if not recording.finished or recording.damages:
                _log.warning(f"{file}: not whole: 'command-post verify' says what is missing")
            with (
                _read_aside(past),
                Background(sources, past.begin_ns, past.end_ns) as background,
                served(
                    lambda ends: make_review_app(
                        Exhibit(past, background, place or past.origin(), drawn), ends
                    ),
                    address,
                    None,
                ),
            ):
                stop.wait()
    except (RecordingError, ValueError, OSError) as error:
        _log.error(str(error))
        return ExitCode.USAGE
    return ExitCode.OK


def _checked(sources: Sources) -> Sources:
    """Return sources whose files are there; what is in them is told where they are used."""
    for path in (sources.plan, sources.settings):
        if path is not None and not path.is_file():
            raise ValueError(f"{path}: no such file; give another")
    return sources


def _address(text: str) -> Address:
    address = listening_address("--page", text, "127.0.0.1:8080")
    if not address.is_local:
        raise ValueError(
            f"--page {text!r}: a recording is shown on this machine alone; use 127.0.0.1:PORT"
        )
    return address


@contextmanager
def _read_aside(past: Past) -> Iterator[None]:
    """Read the estimates of a recording meanwhile."""
    stop = threading.Event()

    def read() -> None:
        """Read on until all is read or nobody wants it any more."""
        try:
            for _ in past.read():
                if stop.is_set():
                    return
        except Exception as error:
            # Who waits for the rest must be told, and what was read can still be shown.
            past.failed = f"the rest cannot be read: {error}"
            _log.error(past.failed)

    thread = threading.Thread(target=read, name="reader")
    thread.start()
    try:
        yield
    finally:
        stop.set()
        thread.join()
