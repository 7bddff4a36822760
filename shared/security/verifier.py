"""Whose word it is: signatures, held against the certificates that nodes have shown (pure)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection
from typing import Literal, TypeAlias

from cryptography import x509
from cryptography.exceptions import InvalidSignature

from shared.gate import UNNAMED, Turned
from shared.seal import Seal, to_be_signed
from shared.security.certificates import (
    BadCertificate,
    CertificateError,
    Identity,
    NodeCertificate,
    read_certificate,
)
from shared.topics import Key

MOST_WANTED = 256
"""Signers that are to be asked for at a time: made-up ones must not use up memory."""

MOST_REFUSED = 4096

Invalid: TypeAlias = Literal["expired", "not_yet_valid", "withdrawn"]


class KnownSigners:
    """Knows nodes by their certificates, which any of them may be shown to have.

    A certificate counts at the receiver's own clock, ``now_ns``, and so is refused from the moment
    that it expires. ``refused`` counts the certificates that were shown and are of no use, by
    reason and by whose they were said to be. One thread at a time may ``learn``, another ask.
    """

    def __init__(
        self,
        authority: x509.Certificate,
        now_ns: Callable[[], int],
        withdrawn: Collection[str] = (),
    ) -> None:
        """``withdrawn``: public keys, in hexadecimal, that are not to be believed."""
        self._authority = authority
        self._now_ns = now_ns
        self._withdrawn = frozenset(withdrawn)
        self._known: dict[Identity, tuple[NodeCertificate, ...]] = {}
        self._wanted: dict[Identity, None] = {}
        self.refused: Counter[tuple[BadCertificate | Invalid, str]] = Counter()

    def verdict(self, key: Key, key_text: str, seal: Seal, /) -> Turned | None:
        """Say why ``seal`` does not show that the node of ``key`` said it; ``None`` if it does.

        Of who is not known, or no more, the certificate is wanted from then on.
        """
        signer = Identity(key.role, key.node_id)
        certificates = self._known.get(signer)
        if not certificates:
            self._want(signer)
            return "unknown_signer"
        said = to_be_signed(key_text, seal.signed)
        for certificate in certificates:
            if _has_signed(certificate, said, seal.signature or b""):
                why = self._invalid(certificate)
                if why is not None:
                    self._want(signer)
                return why
        # It may have been given another key.
        self._want(signer)
        return "forged"

    def learn(
        self, der: bytes, shown_as: Identity | None = None
    ) -> BadCertificate | Invalid | None:
        """Take in a certificate; return what is wrong with it.

        ``shown_as``: whose it is said to be; without, it speaks for itself.
        """
        try:
            certificate = read_certificate(der, self._authority)
        except CertificateError as error:
            return self._refuse(error.kind, shown_as)
        if shown_as is not None and certificate.identity != shown_as:
            return self._refuse("renamed", shown_as)
        why = self._invalid(certificate)
        if why is not None:
            return self._refuse(why, certificate.identity)
        self._keep(certificate)
        return None

    def take_wanted(self) -> list[Identity]:
        """Return whose certificates have been missed since this was last asked."""
        wanted, self._wanted = self._wanted, {}
        return list(wanted)

    def _keep(self, certificate: NodeCertificate) -> None:
        """Keep one certificate for each key of a node: the one that is valid for longest."""
        others = self._known.get(certificate.identity, ())
        same = [one for one in others if one.key_hex == certificate.key_hex]
        newest = max([*same, certificate], key=lambda one: one.not_after_ns)
        apart = [one for one in others if one.key_hex != certificate.key_hex]
        self._known[certificate.identity] = (newest, *apart)

    def _refuse(
        self, why: BadCertificate | Invalid, shown_as: Identity | None
    ) -> BadCertificate | Invalid:
        kind = (why, UNNAMED if shown_as is None else shown_as.node_id)
        if len(self.refused) < MOST_REFUSED or kind in self.refused:
            self.refused[kind] += 1
        return why

    def _invalid(self, certificate: NodeCertificate) -> Invalid | None:
        now_ns = self._now_ns()
        if certificate.key_hex in self._withdrawn:
            return "withdrawn"
        if now_ns >= certificate.not_after_ns:
            return "expired"
        return "not_yet_valid" if now_ns < certificate.not_before_ns else None

    def _want(self, signer: Identity) -> None:
        if len(self._wanted) < MOST_WANTED:
            self._wanted[signer] = None


def _has_signed(certificate: NodeCertificate, said: bytes, signature: bytes) -> bool:
    try:
        certificate.public_key.verify(signature, said)
    except InvalidSignature:
        return False
    return True
