"""``command-post run``: the post at work."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from pathlib import Path
from threading import Event
from typing import Annotated

import structlog
from cyclopts import Parameter
from cyclopts.validators import Number
from rich.console import Console
from rich.live import Live

from command_post.checkpoint import Checkpoints, checkpoint_path, load
from command_post.commands.doors import Doors
from command_post.commands.prepare import make_ready
from command_post.fusion.settings import FusionSettings
from command_post.fusion.team.settings import TeamSettings
from command_post.fusion.time_line import TimeLineSettings
from command_post.incident import Incident, IncidentSettings
from command_post.metrics_server import metrics_address, told
from command_post.plan_file import with_usable_plan
from command_post.post import Post
from command_post.recording import Recorder
from command_post.recording_file import RecorderError
from command_post.recording_mirror import Mirror
from command_post.recording_set import Rotation
from command_post.roster import Roster
from command_post.table import roster_table
from command_post.teams import Teams
from shared.bus.refused_links import RefusedLinks
from shared.bus.zenoh_bus import open_zenoh
from shared.config import checked, load_toml
from shared.continued_clock import continued_clock
from shared.files import FileHeldError, file_held_alone
from shared.gate import Gate
from shared.introductions import Introductions
from shared.mcap_reader import read_recording
from shared.process import (
    ExitCode,
    ended_by_signals,
    stop_on_signals,
    stop_with_parent,
)
from shared.security.certificates import Identity
from shared.security.opening import Insecure, Keys, local_endpoint, open_keys
from shared.sender import Unkept
from shared.stations import read_stations
from shared.strangers import NOBODY, AtLinks
from shared.topics import check_id
from shared.units import NS_PER_S

_log = structlog.stdlib.get_logger(__name__)


def run(
    *,
    incident: str = "incident",
    post_id: Annotated[str, Parameter(name="--id")] = "post",
    record: Path = Path("incident.mcap"),
    rotate_mb: Annotated[float, Parameter(validator=Number(gt=0))] = 256.0,
    rotate_hours: Annotated[float, Parameter(validator=Number(gt=0))] = 1.0,
    listen: str | None = None,
    keys: Keys = None,
    insecure: Insecure = False,
    seed: int = 1,
    particles: int = 1000,
    hold_s: Annotated[float | None, Parameter(name="--hold")] = None,
    horizon_min: Annotated[float, Parameter(name="--horizon", validator=Number(gt=0))] = 40.0,
    lateness_min: Annotated[float, Parameter(name="--lateness", validator=Number(gt=0))] = 60.0,
    plan: Path | None = None,
    stations: Path | None = None,
    teams: Path | None = None,
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
    incident
        Name of the incident; nodes of others are not heard.
    post_id
        Name of this post.
    record
        Where the recording goes; its name must be free. After a kill or a power cut the same
        command goes on with what is unfinished there.
    rotate_mb
        A part of the recording has so many megabytes at most, about; NAME.part002.mcap follows.
    rotate_hours
        A part of the recording is of so many hours at most.
    listen
        Where DAPs and agents find the post; by default port 7447 of this machine alone.
    keys
        Folder of the post's keys: 'command-post keys issue' makes it.
    insecure
        Do without keys, on one machine: nothing is encrypted or authenticated.
    seed
        Of the particle filters' random numbers.
    particles
        For each responder.
    hold_s
        Seconds that events wait for earlier ones before they are fused; 0.1 if not given.
    horizon_min
        Minutes that ways are solved from at least; before that they stay as they were held to be.
    lateness_min
        Minutes after which what comes late is recorded, and not put on the map any more.
    plan
        The building's walls, in GeoJSON: tracks are held to the way they run where people go so.
        One that cannot be used is named, also in the roster, and gone on without.
    stations
        Whose radio is whose, in TOML or CSV: told to DAPs and responders' units (docs/dap.md).
    teams
        Who is of which team, in TOML: who leaves theirs is alerted to (docs/alarms.md).
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
        fusion, refused = with_usable_plan(
            checked(
                FusionSettings(
                    team=checked(
                        TeamSettings(horizon_s=60.0 * horizon_min, lateness_s=60.0 * lateness_min)
                    ),
                    seed=seed,
                    particles=particles,
                )
            ),
            plan,
        )
        if refused is not None:
            _log.error(refused)
        listed = None if stations is None else read_stations(stations)
        settings = IncidentSettings(
            incident=check_id(incident, "--incident"),
            post_id=check_id(post_id, "--id"),
            time_line=checked(TimeLineSettings(hold_s=hold_s)),
            fusion=fusion,
            teams=Teams() if teams is None else load_toml(teams, Teams),
        )
        bundle = open_keys(keys, Identity("post", post_id), insecure=insecure)
        rotation = Rotation(round(rotate_mb * 1e6), round(rotate_hours * 3600 * NS_PER_S))
        address = None if metrics is None else metrics_address(metrics, bundle)
        doors.check(bundle)
        with ended_by_signals():
            make_ready(settings.fusion)
        listened = [listen or local_endpoint(bundle)]
        with (
            stop_on_signals() as stop,
            nullcontext() if bundle is None else RefusedLinks() as links,
            open_zenoh("router", listen=listened, bundle=bundle) as bus,
            Introductions(bus, incident, bundle) as introductions,
        ):
            if with_parent:
                stop_with_parent(stop)
            metadata, mirror = settings.as_metadata(), Mirror(doors.place)
            with (
                file_held_alone(record),
                Recorder(
                    record, metadata, resume=True, mirror=mirror, rotation=rotation
                ) as recorder,
                _shown(table) as show,
                told(address, bundle) as figures,
                doors.opened(incident, post_id, bundle, plan) as guests,
            ):
                state = checkpoint_path(record)
                part = recorder.unfinished
                kept = None if part is None else load(state, part, settings)
                begun = Incident(settings, keeps_all=False) if kept is None else kept.state.incident
                noted = record.with_name(f"{record.name}.clock")
                post = Post(
                    bus, begun, recorder, continued_clock(noted, goes_on=part is not None),
                    follows_exercise=await_start, show=show, gate=Gate(introductions.signers),
                    outbox=Unkept(None if bundle is None else bundle.sign),
                    meet=introductions.meet, sign=None if bundle is None else bundle.sign,
                    metrics=figures, guests=guests,
                    remarks=() if refused is None else (refused,),
                    checkpoints=Checkpoints(state, recorder), stations=listed,
                    at_links=NOBODY if links is None else AtLinks(links.counts, links.breaches),
                )  # fmt: skip
                if part is not None:
                    # It can be broken off: the recording stays as it is, to be gone on with.
                    with ended_by_signals():
                        post.take_up(read_recording(part), kept)
                    mirror.recall(begun.standing)
                return _serve(post, recorder, stop, (state, noted))
    except (ValueError, RecorderError, FileHeldError, OSError) as error:
        _log.error(str(error))
        return ExitCode.USAGE


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
    with Live(console=Console(file=sys.stdout), auto_refresh=False) as live:
        yield lambda roster: live.update(roster_table(roster), refresh=True)
