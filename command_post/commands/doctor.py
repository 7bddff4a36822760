"""``command-post doctor``: what is wrong, before it matters."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Annotated, TypeVar

import msgspec
import structlog
from cyclopts import Parameter
from rich.console import Console
from rich.text import Text

from command_post.doctor.disk import check_recording
from command_post.doctor.finding import Finding, Level, fault, ok
from command_post.doctor.keys import read_bundle, validity
from command_post.doctor.machine import (
    check_clock,
    check_machine_code,
    check_packages,
    check_post_clock,
)
from command_post.doctor.network import can_dial, can_listen
from command_post.fusion.settings import FusionSettings
from command_post.plans.plan_file import with_plan
from shared.process import ExitCode, quieten_logging
from shared.security.bundle import Bundle
from shared.security.opening import local_endpoint
from shared.simulation.scenario import load_scenario
from shared.topics import check_id

T = TypeVar("T")

_STYLES: dict[Level, str] = {"ok": "green", "warning": "yellow", "fault": "bold red"}

_log = structlog.stdlib.get_logger(__name__)


def doctor(
    *,
    keys: Path | None = None,
    incident: str = "incident",
    record: Path = Path("incident.mcap"),
    listen: str | None = None,
    connect: Annotated[tuple[str, ...], Parameter(consume_multiple=False)] = (),
    plan: Path | None = None,
    scenario: str | None = None,
    json: bool = False,
) -> int:
    """Look for what would keep a post from working: give it what the post will be given.

    Exits with 0 if a post would work, else 1. Example: command-post doctor --keys keys/post

    Parameters
    ----------
    keys
        Folder of the post's keys; without, as with --insecure.
    incident
        Name of the incident.
    record
        Where the recording is to go.
    listen
        Where DAPs and agents are to find the post; by default port 7447 of this machine.
    connect
        Posts and DAPs to be dialled, one an option.
    plan
        The building's walls, in GeoJSON.
    scenario
        An exercise's TOML file.
    json
        Print one JSON object, and no table.

    """
    try:
        check_id(incident, "--incident")
    except ValueError as error:
        _log.error(str(error))
        return ExitCode.USAGE
    quieten_logging()
    findings = list(_look(keys, incident, record, listen, connect))
    findings += _read("plan", plan, lambda path: with_plan(FusionSettings(), path))
    findings += _read("scenario", scenario, load_scenario)
    well = all(found.level != "fault" for found in findings)
    if json:
        said = {"well": well, "findings": [found._asdict() for found in findings]}
        sys.stdout.buffer.write(msgspec.json.format(msgspec.json.encode(said)) + b"\n")
    else:
        _show(findings)
    return ExitCode.OK if well else ExitCode.FAILURE


def _look(
    keys: Path | None,
    incident: str,
    record: Path,
    listen: str | None,
    connect: tuple[str, ...],
) -> Iterator[Finding]:
    now_ns = time.time_ns()
    yield from check_packages()
    yield check_machine_code()
    yield from check_clock(now_ns)
    yield from check_recording(record)
    bundle: Bundle | None = None
    if keys is not None:
        bundle, found = read_bundle(keys)
        yield from found
        if bundle is None:
            return
        yield from validity(bundle, now_ns)
    yield from can_listen(listen or local_endpoint(bundle), bundle)
    for endpoint in connect:
        dialled = can_dial(endpoint, bundle)
        yield dialled
        if dialled.level == "ok":
            yield check_post_clock(endpoint, bundle, incident)


def _read(about: str, what: T | None, read: Callable[[T], object]) -> list[Finding]:
    """Return whether a file can be used, if there is one."""
    if what is None:
        return []
    try:
        read(what)
    except (ValueError, OSError) as error:
        return [fault(about, str(error), f"mend the file, or do without --{about}")]
    return [ok(about, f"{what} can be used")]


def _show(findings: list[Finding]) -> None:
    console = Console(file=sys.stdout, soft_wrap=True, highlight=False)
    for found in findings:
        line = Text(f"{found.level:8}", _STYLES[found.level]) + Text(f"{found.about}: {found.says}")
        console.print(line + Text(f"; {found.do}" if found.do else "", "bold"))
