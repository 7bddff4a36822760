"""Whose radio has which address: read from a file, told by the post, looked up by who hears it.

The file is TOML or CSV:

    [responders]
    r1 = "02:00:5e:10:00:01"
    r2 = ["02:00:5e:10:00:02", "f0000000-0000-4000-8000-000000000000/1/2"]
    [daps]
    dap1 = "02:00:5e:10:00:81"

    role,id,address
    responder,r1,02:00:5e:10:00:01
"""

from __future__ import annotations

import csv
import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

import msgspec

from shared.codec import MAX_PAYLOAD_BYTES, encode
from shared.config import ConfigError, load_toml
from shared.messages import NodeId, StationAddress, StationTable
from shared.topics import Role, check_id

MOST_BYTES = MAX_PAYLOAD_BYTES - 1024
"""What a table may come to: a seal is put under it."""

_HEADER = ["role", "id", "address"]
_LISTED: tuple[Role, ...] = ("responder", "dap")
_MAC = re.compile(r"[0-9a-f]{2}([:-]?)[0-9a-f]{2}(?:\1[0-9a-f]{2}){4}")
_UUID = re.compile(r"([0-9a-f]{8}(-[0-9a-f]{4}){3}-[0-9a-f]{12})((?:/[0-9]{1,5}){2})?")
_LARGEST_NUMBER = 0xFFFF
_NOBODYS = ("0" * 12, "f" * 12)


class Stations:
    """The radios that are known, by their addresses."""

    def __init__(self, table: StationTable | None = None) -> None:
        self._owners: dict[StationAddress, tuple[Role, NodeId]] = {}
        if table is not None:
            self._owners |= {address: ("responder", owner) for address, owner in table.responders}
            self._owners |= {address: ("dap", owner) for address, owner in table.daps}

    def __len__(self) -> int:
        return len(self._owners)

    def whose(self, *names: StationAddress) -> tuple[Role, NodeId] | None:
        """Return the role and the name of who has the radio of these names; ``None`` if unknown."""
        return next((self._owners[name] for name in names if name in self._owners), None)


def parse_address(text: str) -> StationAddress:
    """Return an address as tables and scanners write it; ``ValueError`` if it is none.

    A MAC or Bluetooth address may have colons, hyphens or nothing between its bytes; capitals are
    the same as small letters.
    """
    small = text.strip().lower()
    digits = re.sub(r"[:-]", "", small)
    if _MAC.fullmatch(small) and digits not in _NOBODYS:
        return ":".join(digits[at : at + 2] for at in range(0, 12, 2))
    uuid = _UUID.fullmatch(small)
    if uuid is not None:
        numbers = [int(number) for number in (uuid[3] or "").split("/") if number]
        if all(number <= _LARGEST_NUMBER for number in numbers):
            return "/".join([uuid[1], *map(str, numbers)])
    raise ValueError(
        f"address {text!r}: write six bytes as in 02:00:5e:10:00:01, a UUID, or a beacon's "
        "UUID/MAJOR/MINOR"
    )


def read_stations(path: Path) -> StationTable:
    """Return the table in the file at ``path``, numbered 0 at time 0.

    Raises ``ConfigError`` when it cannot be read, for a malformed address or name, for an address
    that is listed twice, and for a table that is too long for one message.
    """
    listed = _read_csv(path) if path.suffix.lower() == ".csv" else _read_toml(path)
    owners: dict[StationAddress, tuple[Role, NodeId]] = {}
    for where, role, node_id, text in listed:
        try:
            address = parse_address(text)
            check_id(node_id, f"{role} id")
        except ValueError as error:
            raise ConfigError(f"{path}: {where}: {error}") from None
        if address in owners:
            raise ConfigError(
                f"{path}: {where}: {address} is listed already, as of {owners[address][1]}; "
                "a radio belongs to one"
            )
        owners[address] = (role, node_id)
    table = StationTable(
        event_time_ns=0, sequence=0, responders=_of(owners, "responder"), daps=_of(owners, "dap")
    )
    if len(encode(table)) > MOST_BYTES:
        raise ConfigError(f"{path}: {len(owners)} addresses are too many for one message")
    return table


class _Listed(NamedTuple):
    """An entry as it is written, and where it stands."""

    where: str
    role: Role
    node_id: str
    address: str


class _TomlTable(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    responders: dict[str, str | tuple[str, ...]] = {}
    daps: dict[str, str | tuple[str, ...]] = {}


def _read_toml(path: Path) -> Iterator[_Listed]:
    table = load_toml(path, _TomlTable)
    by_role: Iterable[tuple[str, Role, dict[str, str | tuple[str, ...]]]] = (
        ("responders", "responder", table.responders),
        ("daps", "dap", table.daps),
    )
    for name, role, nodes in by_role:
        for node_id, addresses in nodes.items():
            for address in (addresses,) if isinstance(addresses, str) else addresses:
                yield _Listed(f"{name}.{node_id}", role, node_id, address)


def _read_csv(path: Path) -> Iterator[_Listed]:
    try:
        rows = list(csv.reader(path.read_text(encoding="utf-8-sig").splitlines(), strict=True))
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read ({error.strerror}); give another") from None
    except (UnicodeDecodeError, csv.Error) as error:
        raise ConfigError(f"{path}: no CSV in UTF-8 ({error}); save it as that") from None
    if not rows or [cell.strip() for cell in rows[0]] != _HEADER:
        raise ConfigError(f"{path}: line 1: begin with the line {','.join(_HEADER)}")
    for number, row in enumerate(rows[1:], 2):
        cells = [cell.strip() for cell in row]
        if not any(cells):
            continue
        if len(cells) != len(_HEADER):
            raise ConfigError(f"{path}: line {number}: write {','.join(_HEADER)}")
        role: Role | None = next((known for known in _LISTED if known == cells[0]), None)
        if role is None:
            raise ConfigError(f"{path}: line {number}: role {cells[0]!r}: write responder or dap")
        yield _Listed(f"line {number}", role, *cells[1:])


def _of(
    owners: dict[StationAddress, tuple[Role, NodeId]], role: Role
) -> tuple[tuple[StationAddress, NodeId], ...]:
    return tuple((address, owner[1]) for address, owner in owners.items() if owner[0] == role)
