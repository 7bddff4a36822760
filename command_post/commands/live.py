"""``command-post run``: the post at work."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from threading import Event
from typing import Annotated, NamedTuple

import structlog
from cyclopts import Parameter
from rich.console import Console
from rich.live import Live

from command_post.commands.doors import Doors
from command_post.commands.post_options import Fusing, PostItself, Record, WhoIsWho
from command_post.commands.prepare import make_ready
from command_post.incident import IncidentSettings
from command_post.metrics.server import metrics_address, told
from command_post.post import Post
from command_post.recorder.file import RecorderError
from command_post.recorder.mirror import Mirror
from command_post.recorder.recording import Recorder
from command_post.resuming.resumption import Resumption
from command_post.roster import Roster
from command_post.table import roster_table
from shared.bus.interface import Bus
from shared.bus.refused_links import counted_at_links
from shared.bus.zenoh_bus import open_zenoh
from shared.continued_clock import continued_clock
from shared.files import FileHeldError, file_held_alone
from shared.gate import Gate
from shared.introductions import Introductions
from shared.process import (
    ExitCode,
    ended_by_signals,
    stop_on_signals,
    stop_with_parent,
)
from shared.security.bundle import Bundle
from shared.sender import Unkept
from shared.strangers import AtLinks

_log = structlog.stdlib.get_logger(__name__)


class _Link(NamedTuple):
    """How the post is linked to all others: who is turned away where they link, it counts."""

    bus: Bus
    introductions: Introductions
    at_links: AtLinks


def run(
    *,
    itself: PostItself = PostItself(),  # noqa: B008 - it is frozen
    keeping: Record = Record(),  # noqa: B008 - it is frozen
    fusing: Fusing = Fusing(),  # noqa: B008 - it is frozen
    who: WhoIsWho = WhoIsWho(),  # noqa: B008 - it is frozen
    table: bool = False,
    metrics: str | None = None,
    doors: Doors = Doors(),  # noqa: B008 - it is frozen
    await_start: bool = False,
    with_parent: Annotated[bool, Parameter(show=False)] = False,
) -> int:
    """Hear an incident, fuse it, record it, until SIGINT or SIGTERM.

    Example: command-post run --incident harbour --record harbour.mcap --keys keys/post
    --listen tls/0.0.0.0:7447 --table

    Parameters
    ----------
    itself
        Who the post is.
    keeping
        What it keeps.
    fusing
        How it fuses.
    who
        Who is who.
    table
        Show the roster on standard output.
    metrics
        HOST:PORT where the post tells how it fares: /metrics for Prometheus, /roster as JSON.
    doors
        Who looks in.
    await_start
        Take the time from the exercise's start, once it is given.
    with_parent
        Stop when standard input closes.

    """
    try:
        fusion, refused = fusing.settings()
        if refused is not None:
            _log.error(refused)
        bundle, stations = itself.open_keys(), who.station_table()
        listen = itself.endpoints(bundle)
        sign = None if bundle is None else bundle.sign
        settings = IncidentSettings(
            incident=itself.incident, post_id=itself.post_id, time_line=fusing.time_line,
            fusion=fusion, teams=who.crews(),
        )  # fmt: skip
        address = None if metrics is None else metrics_address(metrics, bundle)
        doors.check(bundle, itself.post_id)
        mirror = Mirror(doors.place)
        with ended_by_signals():
            make_ready(settings.fusion)
        with (
            stop_on_signals() as stop,
            _linked(itself.incident, listen, bundle) as link,
            _shown(table) as show,
            told(address, bundle) as figures,
            doors.opened(
                itself.incident, itself.post_id, bundle, fusing.plan, settings.teams.teams
            ) as guests,
            # The last: where a port is taken, no recording is begun.
            _recorded(keeping, settings, mirror) as recorder,
        ):
            if with_parent:
                stop_with_parent(stop)
            resumption = Resumption(keeping.record, recorder, settings)
            clock = continued_clock(keeping.noted_clock, goes_on=recorder.unfinished is not None)
            post = Post(
                link.bus, resumption.begin(), recorder, clock, follows_exercise=await_start,
                show=show, gate=Gate(link.introductions.signers), outbox=Unkept(sign),
                meet=link.introductions.meet, sign=sign, metrics=figures, guests=guests,
                remarks=() if refused is None else (refused,),
                checkpoints=resumption.checkpoints, stations=stations, at_links=link.at_links,
            )  # fmt: skip
            with resumption.watched():
                _take_up(post, resumption, mirror)
                return _serve(post, recorder, stop, (*resumption.files, keeping.noted_clock))
    except (ValueError, RecorderError, FileHeldError, OSError) as error:
        _log.error(str(error))
        return ExitCode.USAGE


@contextmanager
def _linked(incident: str, listen: Sequence[str], bundle: Bundle | None) -> Iterator[_Link]:
    """Give the bus, with who has introduced themselves on it."""
    with (
        counted_at_links(bundle) as at_links,
        open_zenoh("router", listen=listen, bundle=bundle) as bus,
        Introductions(bus, incident, bundle) as introductions,
    ):
        yield _Link(bus, introductions, at_links)


@contextmanager
def _recorded(keeping: Record, settings: IncidentSettings, mirror: Mirror) -> Iterator[Recorder]:
    """Give the recorder; nobody else records there."""
    with (
        file_held_alone(keeping.record),
        Recorder(
            keeping.record, settings.as_metadata(), resume=True, mirror=mirror,
            rotation=keeping.rotation,
        ) as recorder,
    ):  # fmt: skip
        yield recorder


def _take_up(post: Post, resumption: Resumption, mirror: Mirror) -> None:
    """Have the post go on with what is unfinished, and draw once more what stands of it."""
    # It can be broken off: the recording stays as it is, to be gone on with.
    with ended_by_signals():
        taken = resumption.take_up(post.take_up)
    if taken is not None:
        mirror.recall(taken.incident.standing)


def _serve(post: Post, recorder: Recorder, stop: Event, to_go_on: Sequence[Path]) -> ExitCode:
    """Serve until ``stop``; say what the recording lacks, and return what the exit says of it."""
    post.serve(stop)
    status = recorder.close()
    if status.fault is None:
        for path in to_go_on:
            path.unlink(missing_ok=True)
    if status.fault is None and not status.dropped:
        return ExitCode.OK
    _log.error("the recording is not whole", fault=status.fault, dropped=status.dropped)
    return ExitCode.FAILURE


@contextmanager
def _shown(table: bool) -> Iterator[Callable[[Roster], None]]:
    """Give what is to be done with each roster: nothing, or to show it on standard output."""
    if not table:
        yield lambda _: None
        return
    console = Console(file=sys.stdout)
    with Live(console=console, auto_refresh=False) as live:
        yield lambda roster: live.update(roster_table(roster), refresh=True)
    if not console.is_terminal:
        # It ends no line in a file or a pipe, where others write on.
        console.print()
