"""Who may see and do what at the page: people with a role and a password, and their sessions.

Passwords are kept as scrypt (RFC 7914) of a salt of their own. A session is a random token that the
browser keeps where no script reads it; what changes anything has to come with a second one.
"""

from __future__ import annotations

import hashlib
import hmac
import secrets
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Literal, NamedTuple, TypeAlias

import msgspec
from msgspec import Meta

from shared.config import load_toml
from shared.messages import NodeId
from shared.token_bucket import TokenBucket

Role: TypeAlias = Literal["viewer", "operator", "commander"]
"""A viewer sees; an operator deals with alerts as well; a commander orders people about as well."""

RANKS: dict[Role, int] = {"viewer": 0, "operator": 1, "commander": 2}

LOCAL_NAME = "local"
"""Whoever sits at the post's own machine, where nobody signs in."""

SESSION_S = 12 * 3600.0
MOST_SESSIONS = 1000
TRIES = 10.0
TRIES_PER_S = 0.2
"""Passwords may be tried so often at once by anybody, and then so often."""

_N, _R, _P = 1 << 14, 8, 1


class Person(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """One who may sign in. ``password`` is ``salt$scrypt`` in hexadecimal."""

    role: Role
    password: Annotated[str, Meta(pattern=r"^[0-9a-f]{32}\$[0-9a-f]{64}$")]


class People(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Everybody who may sign in, by name."""

    people: dict[NodeId, Person] = {}


class Session(NamedTuple):
    """Somebody who has signed in. ``token`` must come with what changes anything."""

    name: NodeId
    role: Role
    token: str
    until_s: float

    def may(self, role: Role) -> bool:
        """Whether what takes ``role`` is theirs to do."""
        return RANKS[self.role] >= RANKS[role]


def hashed(password: str, salt: bytes) -> str:
    """Return a password as a ``Person`` has it."""
    key = hashlib.scrypt(password.encode(), salt=salt, n=_N, r=_R, p=_P, dklen=32)
    return f"{salt.hex()}${key.hex()}"


def load_people(path: Path) -> People:
    """Read the file of those who may sign in. Raises ``shared.config.ConfigError``."""
    return load_toml(path, People)


def people_toml(known: People) -> str:
    """Return everybody as their file has it."""
    entries = (
        f'[people.{name}]\nrole = "{person.role}"\npassword = "{person.password}"\n'
        for name, person in sorted(known.people.items())
    )
    return "\n".join(entries)


class Door:
    """Lets people in, and knows them again."""

    def __init__(self, people: Mapping[NodeId, Person], now_s: float) -> None:
        """``now_s``, as everywhere here, is of a steady clock."""
        self._people = people
        self._sessions: dict[str, Session] = {}
        self._tries = TokenBucket(TRIES_PER_S, TRIES, now_s)

    def sign_in(self, name: str, password: str, now_s: float) -> tuple[str, Session] | None:
        """Return a session and its secret; ``None`` if that is wrong, or tried too often."""
        if not self._tries.take(1.0, now_s):
            return None
        person = self._people.get(name)
        # As much work for a name that nobody has, so that time does not tell which there are.
        salt = bytes.fromhex(person.password.partition("$")[0]) if person else bytes(16)
        tried = hashed(password, salt)
        if person is None or not hmac.compare_digest(tried, person.password):
            return None
        self._forget_old(now_s)
        secret = secrets.token_urlsafe(32)
        session = Session(name, person.role, secrets.token_urlsafe(32), now_s + SESSION_S)
        self._sessions[secret] = session
        return secret, session

    def session(self, secret: str | None, now_s: float) -> Session | None:
        """Return whose session ``secret`` is, if it is one and not over."""
        session = self._sessions.get(secret or "")
        return session if session is not None and now_s < session.until_s else None

    def sign_out(self, secret: str | None) -> None:
        """End a session."""
        self._sessions.pop(secret or "", None)

    def _forget_old(self, now_s: float) -> None:
        self._sessions = {
            secret: session for secret, session in self._sessions.items() if now_s < session.until_s
        }
        while len(self._sessions) >= MOST_SESSIONS:
            del self._sessions[next(iter(self._sessions))]
