"""A node's bundle: one folder with all that it needs to be known, and to know the others.

``command-post keys`` makes it; it is copied onto the device whole. Nothing in it may be told to
anybody but ``private.key``'s owner, and nothing of that file ever gets into a log.
"""

from __future__ import annotations

import os
import stat
from functools import cached_property
from pathlib import Path

import msgspec
from cryptography import x509
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey
from cryptography.hazmat.primitives.serialization import Encoding, load_pem_private_key

from shared.messages import NodeId
from shared.security.certificates import (
    CertificateError,
    Identity,
    NodeCertificate,
    hex_of,
    read_certificate,
)
from shared.topics import Role

AUTHORITY_FILE = "authority.pem"
CERTIFICATE_FILE = "certificate.pem"
KEY_FILE = "private.key"
NODES_FILE = "nodes.json"


class BundleError(ValueError):
    """A bundle cannot be used; the text says what to do."""


class NamedNode(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A node that the authority has named."""

    role: Role
    id: NodeId


class Nodes(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Whom the authority has named when the bundle was made, and which keys it has withdrawn.

    A router lets in those that are named. ``withdrawn`` are public keys in hexadecimal.
    """

    nodes: tuple[NamedNode, ...] = ()
    withdrawn: tuple[str, ...] = ()


class Bundle:
    """A bundle that has been read and found to be whole: the key is the certificate's own."""

    def __init__(self, folder: Path) -> None:
        """Raise ``BundleError`` for a folder that lacks something or is not safe."""
        self.folder = folder
        self.authority = read_pem_certificate(folder / AUTHORITY_FILE)
        self._key = read_private_key(folder / KEY_FILE)
        own = read_pem_certificate(folder / CERTIFICATE_FILE)
        try:
            self.certificate: NodeCertificate = read_certificate(
                own.public_bytes(Encoding.DER), self.authority
            )
        except CertificateError as error:
            raise BundleError(
                f"{folder / CERTIFICATE_FILE}: {error}; copy the bundle anew"
            ) from None
        if hex_of(self._key.public_key()) != self.certificate.key_hex:
            raise BundleError(
                f"{folder}: {KEY_FILE} is not the key of {CERTIFICATE_FILE}; copy the bundle anew"
            )

    @property
    def identity(self) -> Identity:
        """Whose bundle it is."""
        return self.certificate.identity

    @cached_property
    def nodes(self) -> Nodes:
        """Whom the authority has named; ``BundleError`` if the file cannot be read."""
        path = self.folder / NODES_FILE
        try:
            return msgspec.json.decode(path.read_bytes(), type=Nodes)
        except OSError as error:
            raise BundleError(f"{path}: {error.strerror}; copy the bundle anew") from None
        except msgspec.MsgspecError as error:
            raise BundleError(f"{path}: {error}; copy the bundle anew") from None

    def path(self, name: str) -> str:
        """Return where a file of the bundle is, whatever folder becomes the current one."""
        return str((self.folder / name).resolve())

    def sign(self, said: bytes) -> bytes:
        """Return this node's signature, 64 bytes, under ``said``."""
        return self._key.sign(said)


def read_pem_certificate(path: Path) -> x509.Certificate:
    """Return the certificate in ``path``; ``BundleError`` if there is none."""
    try:
        return x509.load_pem_x509_certificate(path.read_bytes())
    except OSError as error:
        raise BundleError(
            f"{path}: {error.strerror}; 'command-post keys issue' makes bundles"
        ) from None
    except ValueError:
        raise BundleError(f"{path}: not a certificate; copy the bundle anew") from None


def read_private_key(path: Path) -> Ed25519PrivateKey:
    """Return the key in ``path``; ``BundleError`` if others may read it, or it is none."""
    try:
        with path.open("rb") as file:
            mode = stat.S_IMODE(os.fstat(file.fileno()).st_mode)
            if os.name == "posix" and mode & 0o077:
                raise BundleError(
                    f"{path}: others may read this private key (mode {mode:03o}); "
                    f"chmod 600 it, and issue another if others had access"
                )
            key = load_pem_private_key(file.read(), password=None)
    except OSError as error:
        raise BundleError(f"{path}: {error.strerror}; copy the bundle anew") from None
    except (ValueError, TypeError) as error:
        if isinstance(error, BundleError):
            raise
        raise BundleError(f"{path}: not a private key; copy the bundle anew") from None
    if not isinstance(key, Ed25519PrivateKey):
        raise BundleError(f"{path}: not an Ed25519 key; copy the bundle anew")
    return key
