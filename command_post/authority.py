"""Our own small authority: names nodes and issues their certificates.

Everything is in one folder: ``authority/`` (its key: whoever has it can name anybody) and, beside
it, one bundle for each node (``shared.security.bundle``). The clocks of devices in the field are
not to be trusted, and some begin at 1970: certificates are valid from then, and short-lived at
the other end.
"""

from __future__ import annotations

import ipaddress
import os
import re
from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager
from datetime import UTC, datetime, timedelta
from pathlib import Path

import msgspec
from cryptography import x509
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey, Ed25519PublicKey
from cryptography.hazmat.primitives.serialization import Encoding, NoEncryption, PrivateFormat
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

from shared.files import held_alone, replace_atomically
from shared.messages import NodeId
from shared.security.bundle import (
    AUTHORITY_FILE,
    CERTIFICATE_FILE,
    KEY_FILE,
    NODES_FILE,
    NamedNode,
    Nodes,
    read_pem_certificate,
    read_private_key,
)
from shared.security.certificates import AUTHORITY_ID, Identity, hex_of
from shared.topics import Role, check_id

ISSUED_FILE = "issued.json"
ORGANISATION = "Clew"
LOOPBACK = ("localhost", "127.0.0.1", "::1")
EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
AUTHORITY_DAYS = 3653

_LABEL = r"[A-Za-z0-9](?:[A-Za-z0-9-]{0,61}[A-Za-z0-9])?"
_HOST_NAME = re.compile(rf"{_LABEL}(?:\.{_LABEL}){{0,30}}")


class AuthorityError(ValueError):
    """The authority cannot do what was asked; the text says what to do."""


class Issued(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A certificate that was issued. ``replaced``: when another took its place, if one did.

    ``withdrawn``: its key is not to be believed any more. ``key_hex`` is the public key.
    """

    role: Role
    id: NodeId
    serial: str
    issued: datetime
    until: datetime
    hosts: tuple[str, ...]
    key_hex: str
    replaced: datetime | None = None
    withdrawn: bool = False


class Authority:
    """The authority in a folder. ``issued`` is all that it has ever issued, oldest first."""

    def __init__(self, folder: Path) -> None:
        """Raise ``AuthorityError`` or ``BundleError`` where there is none that can be used."""
        self.folder = folder
        self._own = folder / AUTHORITY_ID
        if not self._own.is_dir():
            raise AuthorityError(f"{folder}: no authority there; make one with 'keys init'")
        self._key = read_private_key(self._own / KEY_FILE)
        self._certificate = read_pem_certificate(self._own / CERTIFICATE_FILE)
        self.issued = _read_issued(self._own / ISSUED_FILE)

    @classmethod
    def create(cls, folder: Path, now: datetime, days: int = AUTHORITY_DAYS) -> Authority:
        """Make a new authority in ``folder``; ``AuthorityError`` if there is one already."""
        own = folder / AUTHORITY_ID
        if own.exists():
            raise AuthorityError(f"{own}: there is an authority already, and it stays as it is")
        own.mkdir(parents=True, mode=0o700)
        key = Ed25519PrivateKey.generate()
        _write_private(own / KEY_FILE, key)
        _write(own / CERTIFICATE_FILE, _authority_certificate(key, now, days))
        _write_issued(own / ISSUED_FILE, ())
        return cls(folder)

    @property
    def valid(self) -> list[Issued]:
        """What stands: the newest certificate of each node."""
        return [each for each in self.issued if each.replaced is None]

    def issue(
        self,
        identities: Sequence[Identity],
        hosts: Sequence[str],
        now: datetime,
        days: float,
        *,
        replace: bool = False,
    ) -> list[Path]:
        """Name nodes and write their bundles; return the bundles' folders.

        ``hosts``: names and addresses under which others dial them, as they do posts and DAPs.
        With ``replace`` nodes that were named before get new keys, and the old are withdrawn.
        """
        names = tuple(_checked_host(host) for host in hosts)
        for identity in identities:
            self._check_new(identity, names, replace=replace)
        for identity in identities:
            bundle = self.folder / identity.node_id
            bundle.mkdir(mode=0o700, exist_ok=True)
            key = Ed25519PrivateKey.generate()
            certificate = self._certify(identity, key.public_key(), names, now, days)
            _write_private(bundle / KEY_FILE, key)
            self._enter(certificate, identity, names, now, withdraws=replace)
        self._tell_all()
        return [self.folder / identity.node_id for identity in identities]

    def renew(self, node_ids: Collection[str], now: datetime, days: float) -> list[Path]:
        """Prolong the certificates of ``node_ids``, or of all; the keys stay the nodes' own.

        What a journal holds stays believed so. Returns the bundles' folders.
        """
        standing = {each.id: each for each in self.valid}
        unknown = sorted(set(node_ids) - standing.keys())
        if unknown:
            raise AuthorityError(f"never issued: {', '.join(unknown)}; see 'keys list'")
        renewed = [each for each in standing.values() if not node_ids or each.id in node_ids]
        for old in renewed:
            identity = Identity(old.role, old.id)
            key = Ed25519PublicKey.from_public_bytes(bytes.fromhex(old.key_hex))
            (self.folder / old.id).mkdir(mode=0o700, exist_ok=True)
            certificate = self._certify(identity, key, old.hosts, now, days)
            self._enter(certificate, identity, old.hosts, now, withdraws=False)
        self._tell_all()
        return [self.folder / each.id for each in renewed]

    def _check_new(self, identity: Identity, hosts: Collection[str], *, replace: bool) -> None:
        """Raise ``AuthorityError`` if a node cannot be named so."""
        role, node_id = identity
        check_id(node_id, "--id")
        if node_id == AUTHORITY_ID:
            raise AuthorityError(f"--id {node_id!r} is the authority's own; give another")
        if hosts and role == "responder":
            raise AuthorityError("--host: nobody dials a responder; leave it out")
        standing = next((each for each in self.valid if each.id == node_id), None)
        if standing is not None and (not replace or standing.role != role):
            raise AuthorityError(
                f"{node_id!r} is a {standing.role} already; 'keys renew' prolongs it, "
                f"--replace gives a {standing.role} a new key, or give another --id"
            )
        key = self.folder / node_id / KEY_FILE
        if standing is None and key.exists():
            raise AuthorityError(f"{key}: a key that is not ours is there; move it away first")

    def _certify(
        self,
        identity: Identity,
        key: Ed25519PublicKey,
        hosts: Sequence[str],
        now: datetime,
        days: float,
    ) -> x509.Certificate:
        until = min(now + timedelta(days=days), self._certificate.not_valid_after_utc)
        if until <= now:
            raise AuthorityError("the authority itself has expired; make another in a new folder")
        return certificate_of_node(identity, key, hosts, (EPOCH, until), self._key)

    def _enter(
        self,
        certificate: x509.Certificate,
        identity: Identity,
        hosts: tuple[str, ...],
        now: datetime,
        *,
        withdraws: bool,
    ) -> None:
        """Write a node's certificate, and note it as issued."""
        key = certificate.public_key()
        assert isinstance(key, Ed25519PublicKey)  # noqa: S101
        new = Issued(
            role=identity.role, id=identity.node_id, serial=f"{certificate.serial_number:x}",
            issued=now, until=certificate.not_valid_after_utc, hosts=hosts, key_hex=hex_of(key),
        )  # fmt: skip
        self.issued = [*(_superseded(each, new, withdraws=withdraws) for each in self.issued), new]
        bundle = self.folder / identity.node_id
        _write(bundle / CERTIFICATE_FILE, certificate.public_bytes(Encoding.PEM))
        _write(bundle / AUTHORITY_FILE, self._certificate.public_bytes(Encoding.PEM))

    def _tell_all(self) -> None:
        """Write what has been issued, and who has been named into every bundle."""
        _write_issued(self._own / ISSUED_FILE, self.issued)
        withdrawn = {each.key_hex for each in self.issued if each.withdrawn}
        nodes = Nodes(
            nodes=tuple(NamedNode(each.role, each.id) for each in self.valid),
            withdrawn=tuple(sorted(withdrawn)),
        )
        for each in self.valid:
            if (self.folder / each.id).is_dir():
                _write(self.folder / each.id / NODES_FILE, msgspec.json.encode(nodes))


@contextmanager
def opened_authority(folder: Path) -> Iterator[Authority]:
    """Open the authority in ``folder``, for this process alone."""
    if not folder.is_dir():
        raise AuthorityError(f"{folder}: no authority there; make one with 'keys init'")
    with held_alone(folder):
        yield Authority(folder)


def certificate_of_node(
    identity: Identity,
    key: Ed25519PublicKey,
    hosts: Sequence[str],
    valid: tuple[datetime, datetime],
    authority_key: Ed25519PrivateKey,
) -> x509.Certificate:
    """Return a node's certificate. Only posts and DAPs may be dialled, and under ``hosts``.

    ``valid``: from when until when.
    """
    dialled = identity.role != "responder"
    uses = [ExtendedKeyUsageOID.CLIENT_AUTH, *([ExtendedKeyUsageOID.SERVER_AUTH] * dialled)]
    issuer_key = authority_key.public_key()
    builder = (
        _dated(valid)
        .subject_name(_name(identity.role, identity.node_id))
        .issuer_name(_name(ORGANISATION, AUTHORITY_ID))
        .public_key(key)
        .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
        .add_extension(x509.ExtendedKeyUsage(uses), critical=False)
        .add_extension(x509.AuthorityKeyIdentifier.from_issuer_public_key(issuer_key), False)
    )
    if dialled:
        names = dict.fromkeys([*LOOPBACK, *_own_names(identity.node_id), *hosts])
        builder = builder.add_extension(
            x509.SubjectAlternativeName([_general_name(name) for name in names]), critical=False
        )
    return builder.sign(authority_key, None)


def _authority_certificate(key: Ed25519PrivateKey, now: datetime, days: int) -> bytes:
    public = key.public_key()
    usage = x509.KeyUsage(
        digital_signature=False, content_commitment=False, key_encipherment=False,
        data_encipherment=False, key_agreement=False, key_cert_sign=True, crl_sign=True,
        encipher_only=False, decipher_only=False,
    )  # fmt: skip
    certificate = (
        _dated((EPOCH, now + timedelta(days=days)))
        .subject_name(_name(ORGANISATION, AUTHORITY_ID))
        .issuer_name(_name(ORGANISATION, AUTHORITY_ID))
        .public_key(public)
        .add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
        .add_extension(usage, critical=True)
        .add_extension(x509.SubjectKeyIdentifier.from_public_key(public), critical=False)
        .sign(key, None)
    )
    return certificate.public_bytes(Encoding.PEM)


def _dated(valid: tuple[datetime, datetime]) -> x509.CertificateBuilder:
    begin, end = valid
    builder = x509.CertificateBuilder().serial_number(x509.random_serial_number())
    return builder.not_valid_before(begin).not_valid_after(end)


def _name(unit: str, common_name: str) -> x509.Name:
    return x509.Name(
        [
            x509.NameAttribute(NameOID.ORGANIZATIONAL_UNIT_NAME, unit),
            x509.NameAttribute(NameOID.COMMON_NAME, common_name),
        ]
    )


def _own_names(node_id: str) -> tuple[str, ...]:
    """Return the names by which a node is found where names are announced (``ID.local``)."""
    return (node_id, f"{node_id}.local") if _HOST_NAME.fullmatch(node_id) else ()


def _checked_host(host: str) -> str:
    try:
        return str(ipaddress.ip_address(host))
    except ValueError:
        if _HOST_NAME.fullmatch(host):
            return host
    raise AuthorityError(f"--host {host!r}: give a name or an address, without a port") from None


def _general_name(host: str) -> x509.GeneralName:
    try:
        return x509.IPAddress(ipaddress.ip_address(host))
    except ValueError:
        return x509.DNSName(host)


def _superseded(old: Issued, new: Issued, *, withdraws: bool) -> Issued:
    """Return ``old`` as it stands once ``new`` has been issued."""
    if old.id != new.id:
        return old
    return msgspec.structs.replace(
        old, replaced=old.replaced or new.issued, withdrawn=old.withdrawn or withdraws
    )


def _read_issued(path: Path) -> list[Issued]:
    try:
        return msgspec.json.decode(path.read_bytes(), type=list[Issued])
    except OSError as error:
        raise AuthorityError(f"{path}: {error.strerror}; bring it back from a copy") from None
    except msgspec.MsgspecError as error:
        raise AuthorityError(f"{path}: {error}; bring it back from a copy") from None


def _write_issued(path: Path, issued: Sequence[Issued]) -> None:
    _write(path, msgspec.json.format(msgspec.json.encode(issued)))


def _write(path: Path, content: bytes) -> None:
    with replace_atomically(path) as file:
        file.write(content)


def _write_private(path: Path, key: Ed25519PrivateKey) -> None:
    """Write a private key; nobody else can read it, not even while it is being written."""
    with replace_atomically(path) as file:
        if os.name == "posix":
            os.fchmod(file.fileno(), 0o600)
        file.write(key.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption()))
