"""Keys: whole, one's own, valid now, and for the hosts they are used on."""

from __future__ import annotations

import ipaddress
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path

from cryptography import x509

from command_post.doctor.finding import Finding, fault, ok, warning
from shared.security.bundle import Bundle, BundleError
from shared.units import NS_PER_S

SOON_NS = 48 * 3600 * NS_PER_S
RENEW = "'command-post keys renew' where the authority is, and copy the bundle anew"


def read_bundle(folder: Path) -> tuple[Bundle | None, list[Finding]]:
    """Return the bundle in ``folder``, if it can be used, and what is found of it."""
    try:
        bundle = Bundle(folder)
        named = len(bundle.nodes.nodes)
    except BundleError as error:
        says, _, do = str(error).partition("; ")
        return None, [fault("keys", says, do or "copy the bundle anew")]
    role, node_id = bundle.identity
    return bundle, [ok("keys", f"{folder}: those of {role} {node_id!r}, who knows {named} nodes")]


def validity(bundle: Bundle, now_ns: int) -> Iterator[Finding]:
    """Yield whether the certificates are valid at ``now_ns``, and for how long still."""
    own, authority = bundle.certificate, bundle.authority
    spans = {
        "certificate": (own.not_before_ns, own.not_after_ns),
        "authority": (
            round(authority.not_valid_before_utc.timestamp()) * NS_PER_S,
            round(authority.not_valid_after_utc.timestamp()) * NS_PER_S,
        ),
    }
    for what, (begin_ns, end_ns) in spans.items():
        if now_ns < begin_ns:
            yield fault(
                what,
                f"not valid before {_date(begin_ns)}, and this clock reads {_date(now_ns)}",
                "set the clock if it is behind",
            )
        elif now_ns >= end_ns:
            yield fault(what, f"expired on {_date(end_ns)}, by this clock", RENEW)
        elif end_ns - now_ns < SOON_NS:
            yield warning(what, f"expires on {_date(end_ns)}", RENEW)
        else:
            yield ok(what, f"valid until {_date(end_ns)}")


def names_host(bundle: Bundle, host: str) -> Finding:
    """Return whether others that dial ``host`` will take this certificate."""
    certificate = x509.load_der_x509_certificate(bundle.certificate.der)
    try:
        names = certificate.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
    except x509.ExtensionNotFound:
        named = set[str]()
    else:
        named = {*names.get_values_for_type(x509.DNSName)}
        named |= {str(address) for address in names.get_values_for_type(x509.IPAddress)}
    if _unspecified(host):
        return ok("host", f"others dial this node as {', '.join(sorted(named))}")
    if host in named:
        return ok("host", f"the certificate names {host}")
    return fault(
        "host",
        f"the certificate does not name {host}: others refuse it there",
        f"issue it with --host {host}, or listen on one of {', '.join(sorted(named))}",
    )


def _unspecified(host: str) -> bool:
    try:
        return ipaddress.ip_address(host).is_unspecified
    except ValueError:
        return False


def _date(time_ns: int) -> str:
    return datetime.fromtimestamp(time_ns / NS_PER_S, UTC).strftime("%Y-%m-%d %H:%M UTC")
