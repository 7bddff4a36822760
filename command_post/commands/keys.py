"""``command-post keys``: name nodes, and give each what it needs to be known."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated

import msgspec
import structlog
from cyclopts import App, Parameter, validators
from rich.console import Console
from rich.table import Table

from command_post.authority import AUTHORITY_DAYS, Authority, Issued, opened_authority
from shared.files import FolderHeldError
from shared.process import ExitCode
from shared.security.certificates import Identity
from shared.topics import Role

DEFAULT_FOLDER = Path("keys")
DEFAULT_DAYS = 30.0

Folder = Annotated[Path, Parameter(name="--folder")]
Days = Annotated[float, Parameter(validator=validators.Number(gt=0.0, lte=3653.0))]
Ids = Annotated[tuple[str, ...], Parameter(name="--id", consume_multiple=False)]
Hosts = Annotated[tuple[str, ...], Parameter(name="--host", consume_multiple=False)]

_log = structlog.stdlib.get_logger(__name__)

keys = App(name="keys", help="Name nodes, and give each what it needs to be known by the others.")


@keys.command
def init(*, folder: Folder = DEFAULT_FOLDER, days: Days = AUTHORITY_DAYS) -> int:
    """Make a new authority. Whoever has its folder can name anybody: keep it off the network.

    Example: command-post keys init --folder keys

    Parameters
    ----------
    folder
        Where it is kept, and where the nodes' bundles go.
    days
        How long it is valid.

    """
    try:
        Authority.create(folder, _now(), round(days))
    except (ValueError, OSError) as error:
        return _refuse(error)
    _console().print(f"an authority is in {folder}; name nodes with 'command-post keys issue'")
    return ExitCode.OK


@keys.command
def issue(
    *,
    role: Role,
    node_ids: Ids,
    hosts: Hosts = (),
    folder: Folder = DEFAULT_FOLDER,
    days: Days = DEFAULT_DAYS,
    replace: Annotated[bool, Parameter(negative="")] = False,
) -> int:
    """Name nodes, and write a bundle for each: a folder to be copied onto its device whole.

    Example: command-post keys issue --role dap --id dap1 --host 192.168.7.11

    Parameters
    ----------
    role
        What they are.
    node_ids
        Their names, one an option; each is one of a kind, whatever its role.
    hosts
        Names and addresses under which others dial them (posts and DAPs), one an option. Those
        of this machine, ID and ID.local are always among them.
    folder
        Where the authority is.
    days
        How long they are valid.
    replace
        Give nodes that have been named before new keys; the old ones are not believed any more.

    """
    if not node_ids:
        return _refuse(ValueError("issue: give at least one --id"))
    try:
        with opened_authority(folder) as authority:
            named = [Identity(role, node_id) for node_id in dict.fromkeys(node_ids)]
            for bundle in authority.issue(named, hosts, _now(), days, replace=replace):
                _console().print(f"{bundle}: copy this folder onto {bundle.name}", highlight=False)
            _tell_routers(authority)
    except (ValueError, OSError, FolderHeldError) as error:
        return _refuse(error)
    return ExitCode.OK


@keys.command
def renew(*, node_ids: Ids = (), folder: Folder = DEFAULT_FOLDER, days: Days = DEFAULT_DAYS) -> int:
    """Prolong certificates, of all nodes or of some. Their keys stay as they are.

    Example: command-post keys renew --days 14

    Parameters
    ----------
    node_ids
        Whose, one an option; all if none is given.
    folder
        Where the authority is.
    days
        How long they are valid from now on.

    """
    try:
        with opened_authority(folder) as authority:
            for bundle in authority.renew(node_ids, _now(), days):
                _console().print(f"{bundle}: copy onto {bundle.name} again", highlight=False)
            _tell_routers(authority)
    except (ValueError, OSError, FolderHeldError) as error:
        return _refuse(error)
    return ExitCode.OK


@keys.command(name="list")
def list_issued(*, folder: Folder = DEFAULT_FOLDER, json: bool = False) -> int:
    """Show what has been issued, until when it is valid, and what has been replaced.

    Example: command-post keys list --folder keys

    Parameters
    ----------
    folder
        Where the authority is.
    json
        Print it as one JSON list.

    """
    try:
        authority = Authority(folder)
    except (ValueError, OSError) as error:
        return _refuse(error)
    if json:
        told = [
            {**msgspec.to_builtins(each), "state": _state(each, _now())}
            for each in authority.issued
        ]
        sys.stdout.write(msgspec.json.encode(told).decode() + "\n")
    else:
        _console().print(_issued_table(authority.issued, _now()))
    return ExitCode.OK


def _issued_table(issued: Sequence[Issued], now: datetime) -> Table:
    table = Table("role", "id", "issued", "until", "state", "hosts")
    for each in issued:
        table.add_row(
            each.role, each.id, f"{each.issued:%Y-%m-%d %H:%M}", f"{each.until:%Y-%m-%d %H:%M}",
            _state(each, now), " ".join(each.hosts),
        )  # fmt: skip
    return table


def _state(issued: Issued, now: datetime) -> str:
    if issued.withdrawn:
        return "withdrawn"
    if issued.replaced is not None:
        return "replaced"
    return "valid" if now < issued.until else "expired"


def _tell_routers(authority: Authority) -> None:
    """Say who has to be told of a change: posts and DAPs let in those whom they know of."""
    routers = sorted(each.id for each in authority.valid if each.role != "responder")
    if routers:
        _console().print(
            f"who is named is told to posts and DAPs by nodes.json in their bundles: copy it onto "
            f"{', '.join(routers)} as well, and start them anew",
            highlight=False,
        )


def _refuse(error: Exception) -> ExitCode:
    _log.error(str(error))
    return ExitCode.USAGE


def _now() -> datetime:
    return datetime.now(UTC).replace(microsecond=0)


def _console() -> Console:
    return Console(file=sys.stdout, soft_wrap=True)
