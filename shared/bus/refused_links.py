"""Who was refused a link, and why: counted and told.

Zenoh says it in its log alone, and can write that to standard output alone. So as long as this
listens, what Zenoh writes there goes into a pipe; what Python writes goes where it always did.
"""

from __future__ import annotations

import os
import sys
import threading
from collections import Counter
from typing import TextIO

import structlog
import zenoh

LOGGED = "zenoh_link_tls=warn,zenoh::net::routing::interceptor::access_control=info"

_REASONS = {
    "did not match any configured ACL subject": "not_named",
    "sent no certificates": "no_certificate",
    "certificate expired": "expired",
    "certificate not valid yet": "not_yet_valid",
    "invalid peer certificate": "foreign",
    "received fatal alert": "does_not_accept_ours",
    "corrupt message": "not_tls",
    "handshake eof": "broken_off",
}
"""What its words mean; the first that is found counts."""

_WORDS = {
    "not_named": "a node has a link and is mute: nodes.json of these keys does not name it",
    "does_not_accept_ours": "a link was refused by who dialled: it does not accept our certificate",
}

_log = structlog.stdlib.get_logger(__name__)


class RefusedLinks:
    """In its ``with`` block, ``counts`` the refused links of this process's routers, by reason.

    ``not_named`` are those who got a link, and are let say nothing. To be entered before a router
    opens, and by one at a time.
    """

    def __init__(self) -> None:
        self.counts: Counter[str] = Counter()
        self._thread = threading.Thread(target=self._read, name="refused-links", daemon=True)

    def __enter__(self) -> RefusedLinks:
        sys.stdout.flush()
        self._former: TextIO = sys.stdout
        self._kept = os.dup(1)
        self._reading, writing = os.pipe()
        # A log line is rather lost than waited for: Zenoh writes it while it works.
        os.set_blocking(writing, False)
        os.dup2(writing, 1)
        os.close(writing)
        sys.stdout = os.fdopen(os.dup(self._kept), "w", encoding="utf-8")
        self._thread.start()
        _log_once()
        return self

    def __exit__(self, *_: object) -> None:
        sys.stdout.close()
        sys.stdout = self._former
        os.dup2(self._kept, 1)
        os.close(self._kept)
        self._thread.join()
        for reason, count in sorted(self.counts.items()):
            _log.warning("links refused in all", reason=reason, count=count)

    def note(self, line: str) -> None:
        """Take in a line of Zenoh's log."""
        reason = next((why for words, why in _REASONS.items() if words in line), None)
        if reason is None:
            return
        self.counts[reason] += 1
        count = self.counts[reason]
        if count == 10 ** (len(str(count)) - 1):
            _log.warning(_WORDS.get(reason, "a link was refused"), reason=reason, count=count)

    def _read(self) -> None:
        with os.fdopen(self._reading, encoding="utf-8", errors="replace") as lines:
            for line in lines:
                self.note(line)


_initialized = threading.Lock()


def _log_once() -> None:
    """Have Zenoh log, from now on; it takes that once in a process."""
    if _initialized.acquire(blocking=False):
        zenoh.init_log_from_env_or(LOGGED)
