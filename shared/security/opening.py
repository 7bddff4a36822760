"""How a program comes by its keys: ``--keys FOLDER``, or ``--insecure`` on one machine."""

from __future__ import annotations

import threading
import time
from pathlib import Path

import structlog

from shared.security.bundle import Bundle, BundleError
from shared.security.certificates import Identity
from shared.units import NS_PER_S

PORT = 7447
SOON_NS = 48 * 3600 * NS_PER_S

_log = structlog.stdlib.get_logger(__name__)


def open_keys(keys: Path | None, identity: Identity, *, insecure: bool) -> Bundle | None:
    """Return the keys that the command line names; ``None`` where it says to do without.

    Raises ``BundleError`` for keys that cannot be used or are not of ``identity``, and where the
    command line says neither or both.
    """
    if keys is None:
        if not insecure:
            raise BundleError(
                "give --keys FOLDER, this node's keys (see 'command-post keys --help'), or "
                "--insecure to try it on this machine alone, unencrypted and unauthenticated"
            )
        _log.warning("nothing is encrypted or authenticated (--insecure): on this machine alone")
        return None
    if insecure:
        raise BundleError("--keys or --insecure: give one of them")
    bundle = Bundle(keys)
    if bundle.identity != identity:
        raise BundleError(
            f"{keys}: keys of {bundle.identity.role} {bundle.identity.node_id!r}, "
            f"not of {identity.role} {identity.node_id!r}; give its own"
        )
    _tell_of_validity(bundle, time.time_ns())
    return bundle


def local_endpoint(bundle: Bundle | None, port: int = PORT) -> str:
    """Return the endpoint on this machine that programs meet at if no other is given."""
    return f"{'tcp' if bundle is None else 'tls'}/127.0.0.1:{port}"


def _tell_of_validity(bundle: Bundle, now_ns: int) -> None:
    """Say when a certificate is not valid, or not for long; by a clock that may be wrong."""
    certificate = bundle.certificate
    left_h = (certificate.not_after_ns - now_ns) / (3600 * NS_PER_S)
    advice = "'command-post keys renew' prolongs it"
    expired = f"the certificate has expired, by this clock: no link comes about; {advice}"
    if now_ns >= certificate.not_after_ns:
        _log.error(expired)
    elif now_ns < certificate.not_before_ns:
        _log.error("the certificate is not valid yet, by this clock: no link comes about")
    elif certificate.not_after_ns - now_ns < SOON_NS:
        _log.warning(f"the certificate expires soon; {advice}", hours=round(left_h, 1))
        # Links close then, and who runs this would not be told why.
        left_s = (certificate.not_after_ns - now_ns) / NS_PER_S
        telling = threading.Timer(left_s, _log.error, (expired,))
        telling.daemon = True
        telling.start()
