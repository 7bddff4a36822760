"""Keys for tests: bundles of an authority of their own, good ones and bad ones."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC, datetime, timedelta
from pathlib import Path

from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey
from cryptography.hazmat.primitives.serialization import Encoding

from command_post.authority import EPOCH, Authority, certificate_of_node
from shared.security.bundle import Bundle, read_private_key
from shared.security.certificates import Identity
from shared.topics import Role

DAYS = 30.0

ROLES: dict[str, Role] = {"post": "post", "commander": "post", "dap1": "dap", "dap2": "dap",
                          "r1": "responder", "r2": "responder"}  # fmt: skip


def now() -> datetime:
    return datetime.now(UTC).replace(microsecond=0)


def identity(name: str) -> Identity:
    """Return who ``name`` is: roles go by ``ROLES``, and others are responders."""
    return Identity(ROLES.get(name, "responder"), name)


class Keys:
    """An authority and the bundles it has issued, by their names."""

    def __init__(self, folder: Path, names: Sequence[str] = tuple(ROLES)) -> None:
        self.authority = Authority.create(folder, now())
        self.issue(*names)

    def __getitem__(self, name: str) -> Bundle:
        return Bundle(self.authority.folder / name)

    def issue(self, *names: str) -> None:
        """Name nodes, and tell all bundles of them."""
        self.authority.issue([identity(name) for name in names], (), now(), DAYS)

    def date(self, name: str, begin: datetime = EPOCH, end: datetime | None = None) -> Bundle:
        """Give ``name`` a certificate of another validity; return its bundle."""
        valid = (begin, now() + timedelta(days=DAYS) if end is None else end)
        folder = self.authority.folder
        signer = read_private_key(folder / "authority" / "private.key")
        node_key = read_private_key(folder / name / "private.key")
        write_certificate(folder / name, identity(name), node_key, valid, signer)
        return self[name]


def write_certificate(
    folder: Path,
    who: Identity,
    key: Ed25519PrivateKey,
    valid: tuple[datetime, datetime],
    signer: Ed25519PrivateKey,
) -> None:
    certificate = certificate_of_node(who, key.public_key(), (), valid, signer)
    (folder / "certificate.pem").write_bytes(certificate.public_bytes(Encoding.PEM))
