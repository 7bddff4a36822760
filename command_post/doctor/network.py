"""Ports: free to listen on; reachable, and speaking what is expected of them."""

from __future__ import annotations

import errno
import socket
import ssl
from collections.abc import Iterator
from contextlib import suppress

from command_post.doctor.finding import Finding, fault, ok
from command_post.doctor.keys import names_host
from shared.bus.zenoh_settings import check_dialled, check_endpoint
from shared.security.bundle import AUTHORITY_FILE, CERTIFICATE_FILE, KEY_FILE, Bundle

PATIENCE_S = 3.0
WORD_S = 0.5
"""A node that does not want us says so within this."""

START_WITH_KEYS = "start that node with its --keys; if it has them, it hangs: start it anew"

_WRONG = "WRONG_VERSION_NUMBER", "RECORD_LAYER_FAILURE", "UNEXPECTED_EOF", "HTTP_REQUEST"


def can_listen(endpoint: str, bundle: Bundle | None) -> Iterator[Finding]:
    """Yield whether a post could listen on ``endpoint``."""
    about = f"listen {endpoint}"
    try:
        check_endpoint(endpoint, bundle)
    except ValueError as error:
        yield fault(about, *_told(error))
        return
    host, port = _place(endpoint)
    if bundle is not None:
        yield names_host(bundle, host)
    try:
        family = socket.AF_INET6 if ":" in host else socket.AF_INET
        with socket.create_server((host, port), family=family):
            yield ok(about, "nobody else listens there")
    except OSError as error:
        yield fault(about, *_why_not_listened(error))


def can_dial(endpoint: str, bundle: Bundle | None) -> Finding:
    """Return whether a post or a DAP answers at ``endpoint``, and as it should."""
    about = f"connect {endpoint}"
    try:
        check_dialled(endpoint, bundle)
    except ValueError as error:
        return fault(about, *_told(error))
    try:
        with socket.create_connection(_place(endpoint), timeout=PATIENCE_S) as link:
            return _spoken(about, link, _place(endpoint)[0], bundle)
    except OSError as error:
        return fault(about, *_why_not_dialled(error))


def _spoken(about: str, link: socket.socket, host: str, bundle: Bundle | None) -> Finding:
    if bundle is None:
        return _plain(about, link)
    context = ssl.create_default_context(cafile=bundle.path(AUTHORITY_FILE))
    context.verify_flags &= ~getattr(ssl, "VERIFY_X509_STRICT", 0)
    context.load_cert_chain(bundle.path(CERTIFICATE_FILE), bundle.path(KEY_FILE))
    try:
        with context.wrap_socket(link, server_hostname=host) as secured:
            # Whether our own certificate is taken is only heard after the handshake.
            secured.settimeout(WORD_S)
            with suppress(TimeoutError):
                secured.recv(1)
            return ok(about, "answers, and each knows the other's certificate")
    except TimeoutError:
        return fault(about, "takes the call and says no word of TLS", START_WITH_KEYS)
    except ssl.SSLCertVerificationError as error:
        return fault(about, *_why_not_believed(error, host))
    except ssl.SSLError as error:
        return fault(about, *_why_not_secured(error))


def _plain(about: str, link: socket.socket) -> Finding:
    """Return whether it is plain there, by whether it would speak TLS."""
    context = ssl.create_default_context()
    context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
    try:
        with context.wrap_socket(link):
            return fault(about, "speaks TLS", "give --keys, and write tls/HOST:PORT")
    except OSError:
        return ok(about, "answers, unencrypted")


def _why_not_listened(error: OSError) -> tuple[str, str]:
    match error.errno:
        case errno.EADDRINUSE:
            return "in use by another program", "end it if it is an old post, or use another port"
        case errno.EADDRNOTAVAIL:
            return "no address of this machine", "use one that 'ip address' shows, or 0.0.0.0"
        case errno.EACCES:
            return "a port that only root may use", "use one above 1023"
        case _:
            return f"cannot listen: {error.strerror or error}", "use another address"


def _why_not_dialled(error: OSError) -> tuple[str, str]:
    if isinstance(error, socket.gaierror):
        return "no machine of that name is known", "write its address, or mend the name service"
    if isinstance(error, TimeoutError):
        return f"no answer within {PATIENCE_S:g} s", "see that it is on, in range, and let through"
    if isinstance(error, ConnectionRefusedError):
        return "the machine is there, and nobody listens", "start the post or DAP, or mend the port"
    return f"cannot be reached: {error.strerror or error}", "join the network that it is on"


def _why_not_believed(error: ssl.SSLCertVerificationError, host: str) -> tuple[str, str]:
    message = error.verify_message.lower()
    if "expired" in message:
        return "its certificate has expired", "renew that node's, or set this clock"
    if "not yet valid" in message:
        return "its certificate is not valid yet", "set the clock of this machine, it is behind"
    if "mismatch" in message or "not valid for" in message:
        return (
            f"its certificate is not for {host}",
            f"issue that node's with --host {host}, or dial it by a name that it has",
        )
    return (
        f"its certificate is not by our authority ({error.verify_message})",
        "give both nodes bundles of one authority",
    )


def _why_not_secured(error: ssl.SSLError) -> tuple[str, str]:
    reason = (error.reason or str(error)).upper()
    if any(wrong in reason for wrong in _WRONG):
        return "does not speak TLS", START_WITH_KEYS
    if "ALERT" in reason:
        words = reason.replace("_", " ").lower()
        return f"it refuses our certificate ({words})", "renew ours, or tell it of the new nodes"
    return f"no TLS link comes about ({reason.replace('_', ' ').lower()})", "renew both bundles"


def _told(error: ValueError) -> tuple[str, str]:
    says, _, do = str(error).partition("; ")
    return says, do


def _place(endpoint: str) -> tuple[str, int]:
    host, _, port = endpoint.partition("/")[2].rpartition(":")
    return host.strip("[]"), int(port)
