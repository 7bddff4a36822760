"""``command-post people``: who may sign in at the page."""

from __future__ import annotations

import getpass
import secrets
import sys
from pathlib import Path
from typing import Annotated

import msgspec
import structlog
from cyclopts import App, Parameter
from rich.console import Console

from command_post.web.people import People, Person, Role, hashed, load_people, people_toml
from shared.config import ConfigError
from shared.files import replace_atomically
from shared.process import ExitCode
from shared.topics import check_id

DEFAULT_FILE = Path("people.toml")
LEAST_LETTERS = 8

File = Annotated[Path, Parameter(name="--file")]

_log = structlog.stdlib.get_logger(__name__)

people = App(name="people", help="Say who may sign in at the page, and as what.")


@people.command
def add(name: str, /, *, role: Role, file: File = DEFAULT_FILE) -> int:
    """Let somebody sign in, or give them another role or password.

    The password is asked for, or read from standard input where that is no terminal.
    Example: command-post people add kim --role commander --file people.toml

    Parameters
    ----------
    name
        Who: it stands in the record beside what they do.
    role
        A viewer sees, an operator deals with alerts as well, a commander gives orders as well.
    file
        Where they are kept.

    """
    try:
        check_id(name, "name")
        known = dict(_known(file).people)
        password = _asked_for()
        known[name] = Person(role=role, password=hashed(password, secrets.token_bytes(16)))
        _keep(file, People(people=known))
    except (ValueError, OSError) as error:
        _log.error(str(error))
        return ExitCode.USAGE
    Console().print(f"{name} may sign in as {role}", highlight=False)
    return ExitCode.OK


@people.command
def remove(name: str, /, *, file: File = DEFAULT_FILE) -> int:
    """Let somebody sign in no more; a post that runs heeds it when it is started again.

    Example: command-post people remove kim --file people.toml

    Parameters
    ----------
    name
        Who.
    file
        Where they are kept.

    """
    try:
        known = dict(load_people(file).people)
        if known.pop(name, None) is None:
            raise ConfigError(f"{file}: nobody called {name!r}; 'command-post people list' has all")
        _keep(file, People(people=known))
    except (ValueError, OSError) as error:
        _log.error(str(error))
        return ExitCode.USAGE
    return ExitCode.OK


@people.command(name="list")
def list_(
    *, file: File = DEFAULT_FILE, json: Annotated[bool, Parameter(negative="")] = False
) -> int:
    """List who may sign in, and as what.

    Example: command-post people list --file people.toml

    Parameters
    ----------
    file
        Where they are kept.
    json
        Print one JSON object.

    """
    try:
        roles = {name: person.role for name, person in sorted(load_people(file).people.items())}
    except ValueError as error:
        _log.error(str(error))
        return ExitCode.USAGE
    lines = [f"{name}: {role}" for name, role in roles.items()]
    text = msgspec.json.encode(roles).decode() if json else "\n".join(lines)
    Console().print(text, highlight=False, markup=False, soft_wrap=True)
    return ExitCode.OK


def _known(file: Path) -> People:
    return load_people(file) if file.exists() else People()


def _asked_for() -> str:
    if sys.stdin.isatty():
        password = getpass.getpass("password: ")
        if password != getpass.getpass("once more: "):
            raise ValueError("the passwords are not the same; nothing has changed")
    else:
        password = sys.stdin.readline().rstrip("\n")
    if len(password) < LEAST_LETTERS:
        raise ValueError(f"give a password of {LEAST_LETTERS} letters or more")
    return password


def _keep(file: Path, known: People) -> None:
    with replace_atomically(file) as written:
        Path(written.name).chmod(0o600)
        written.write(people_toml(known).encode())
