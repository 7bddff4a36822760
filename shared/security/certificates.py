"""Certificates of nodes, as whoever receives one reads it (pure).

Common name: the node's id, one of a kind across the authority. Organisational unit: its role.
Ed25519 keys (RFC 8032, RFC 8410) throughout: the same one authenticates links and signs messages.
"""

from __future__ import annotations

from typing import Literal, NamedTuple, TypeAlias

from cryptography import x509
from cryptography.exceptions import InvalidSignature
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PublicKey
from cryptography.hazmat.primitives.serialization import Encoding, PublicFormat
from cryptography.x509.oid import NameOID

from shared.topics import ROLES, Role, check_id
from shared.units import NS_PER_S

AUTHORITY_ID = "authority"
"""The authority's own common name: no node can have it."""

MOST_BYTES = 4096

BadCertificate: TypeAlias = Literal["foreign", "renamed", "unreadable"]
"""``foreign``: another authority's; ``renamed``: not of the node that shows it."""


class CertificateError(ValueError):
    """Bytes are no certificate of ours; ``kind`` is what to count it by."""

    def __init__(self, kind: BadCertificate, detail: str) -> None:
        super().__init__(detail)
        self.kind: BadCertificate = kind


class Identity(NamedTuple):
    """Who a node is."""

    role: Role
    node_id: str


class NodeCertificate(NamedTuple):
    """What the authority vouches for. Times are Unix ones; ``der`` is the whole of it."""

    identity: Identity
    public_key: Ed25519PublicKey
    not_before_ns: int
    not_after_ns: int
    der: bytes

    @property
    def key_hex(self) -> str:
        """The public key's 32 bytes in hexadecimal: what a withdrawn key is told by."""
        return hex_of(self.public_key)


def hex_of(key: Ed25519PublicKey) -> str:
    """Return the 32 bytes of ``key`` in hexadecimal."""
    return key.public_bytes(Encoding.Raw, PublicFormat.Raw).hex()


def read_certificate(der: bytes, authority: x509.Certificate) -> NodeCertificate:
    """Return what ``der`` says, if ``authority`` signed it; else raise ``CertificateError``.

    Whether it is valid now is for whoever knows the time.
    """
    if len(der) > MOST_BYTES:
        raise CertificateError("unreadable", f"{len(der)} bytes: no certificate of ours")
    try:
        certificate = x509.load_der_x509_certificate(der)
        certificate.verify_directly_issued_by(authority)
    except InvalidSignature:
        raise CertificateError("foreign", "signed by another authority") from None
    except (ValueError, TypeError) as error:
        raise CertificateError("unreadable", f"not a certificate of ours: {error}") from None
    key = certificate.public_key()
    if not isinstance(key, Ed25519PublicKey):
        raise CertificateError("unreadable", "its key is not an Ed25519 one")
    return NodeCertificate(
        identity_in(certificate.subject),
        key,
        round(certificate.not_valid_before_utc.timestamp()) * NS_PER_S,
        round(certificate.not_valid_after_utc.timestamp()) * NS_PER_S,
        der,
    )


def identity_in(subject: x509.Name) -> Identity:
    """Return who a certificate's ``subject`` is; ``CertificateError`` if it is no node."""
    units = subject.get_attributes_for_oid(NameOID.ORGANIZATIONAL_UNIT_NAME)
    names = subject.get_attributes_for_oid(NameOID.COMMON_NAME)
    role = next((known for known in ROLES if [each.value for each in units] == [known]), None)
    if role is None or len(names) != 1:
        raise CertificateError("unreadable", "its subject is not a role and an id")
    try:
        return Identity(role, check_id(str(names[0].value), "its common name"))
    except ValueError as error:
        raise CertificateError("unreadable", str(error)) from None
