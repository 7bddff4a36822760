"""Who was refused a link, and why, and who says what is not theirs to say: counted and told.

Zenoh says it in its log alone, and can write that to standard output alone. So as long as this
listens, what Zenoh writes there goes into a pipe; what Python writes goes where it always did.
"""

from __future__ import annotations

import os
import re
import sys
import threading
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import TextIO

import structlog
import zenoh

from shared.bus.access_log import ACCESS_TARGET, TELLING, AccessLog, Act, Breach
from shared.security.bundle import Bundle
from shared.strangers import NOBODY, AtLinks
from shared.topics import is_id

if sys.platform == "linux":
    import fcntl

LOGGED = f"zenoh_link_tls=warn,{ACCESS_TARGET}=trace"
"""A link that may say nothing is told of as a warning, what is not let pass in the trace alone."""

PIPE_BYTES = 1 << 20
CHUNK_BYTES = 1 << 16
MOST_NAMED = 1000
_NODE_CHUNK = 4

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

_OF_INTEREST = re.compile("|".join([*map(re.escape, _REASONS), *TELLING]).encode())

_log = structlog.stdlib.get_logger(__name__)


@contextmanager
def counted_at_links(bundle: Bundle | None) -> Iterator[AtLinks]:
    """Give what this process's routers refuse, as it is counted; without keys that is nothing.

    To be entered before a router opens.
    """
    if bundle is None:
        yield NOBODY
        return
    with RefusedLinks() as links:
        yield AtLinks(links.counts, links.breaches)


class RefusedLinks:
    """In its ``with`` block, ``counts`` the refused links of this process's routers, by reason.

    ``not_named`` are those who got a link, and are let say nothing. ``breaches`` counts what nodes
    with a link put under keys that are not theirs: by who says so, and the node that is named;
    ``overreaches`` what else they are not let: by who, and whether they ask, listen, answer, or
    would be there. To be entered before a router opens, and by one at a time.
    """

    def __init__(self) -> None:
        self.counts: Counter[str] = Counter()
        self.breaches: Counter[tuple[str, str]] = Counter()
        self.overreaches: Counter[tuple[str, Act]] = Counter()
        self._access = AccessLog()
        self._thread = threading.Thread(target=self._read, name="refused-links", daemon=True)

    def __enter__(self) -> RefusedLinks:
        sys.stdout.flush()
        self._former: TextIO = sys.stdout
        self._kept = os.dup(1)
        self._reading, writing = os.pipe()
        # A log line is rather lost than waited for: Zenoh writes it while it works.
        os.set_blocking(writing, False)
        _widen(writing)
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
        for (sender_id, named), count in sorted(self.breaches.items()):
            _log.warning("not let say in all", node_id=sender_id, named=named, count=count)
        for (sender_id, would), count in sorted(self.overreaches.items()):
            _log.warning("not let in all", node_id=sender_id, would=would, count=count)

    def note(self, line: str) -> None:
        """Take in a line of Zenoh's log."""
        breach = self._access.take(line)
        if breach is not None:
            if breach.act == "say":
                self._note_breach(breach.sender_id, breach.key)
            else:
                self._note_overreach(breach)
            return
        reason = next((why for words, why in _REASONS.items() if words in line), None)
        if reason is None:
            return
        self.counts[reason] += 1
        count = self.counts[reason]
        if _is_told(count):
            _log.warning(_WORDS.get(reason, "a link was refused"), reason=reason, count=count)

    def _note_breach(self, sender_id: str, key: str) -> None:
        chunks = key.split("/")
        named = chunks[_NODE_CHUNK] if len(chunks) > _NODE_CHUNK else ""
        who = (sender_id, named if is_id(named) else "")
        if who not in self.breaches and len(self.breaches) >= MOST_NAMED:
            who = (sender_id, "")
        self.breaches[who] += 1
        if _is_told(self.breaches[who]):
            _log.warning(
                "a node says what is not its own to say, and is not let",
                node_id=sender_id, key=key, count=self.breaches[who],
            )  # fmt: skip

    def _note_overreach(self, breach: Breach) -> None:
        who = (breach.sender_id, breach.act)
        if who not in self.overreaches and len(self.overreaches) >= MOST_NAMED:
            who = ("", breach.act)
        self.overreaches[who] += 1
        if _is_told(self.overreaches[who]):
            _log.warning(
                "a node would do what it may not, and is not let", node_id=breach.sender_id,
                would=breach.act, key=breach.key, count=self.overreaches[who],
            )  # fmt: skip

    def _read(self) -> None:
        # Of each message that is let pass there is a line: most are passed over together.
        rest = b""
        with os.fdopen(self._reading, "rb", buffering=0) as log:
            while read := log.read(CHUNK_BYTES):
                lines, newline, rest = (rest + read).rpartition(b"\n")
                if newline and _OF_INTEREST.search(lines):
                    for line in lines.split(b"\n"):
                        self.note(line.decode(errors="replace"))
                rest = rest[-CHUNK_BYTES:]


def _is_told(count: int) -> bool:
    """Say whether so many are told of: at powers of ten."""
    return str(count).rstrip("0") == "1"


def _widen(pipe: int) -> None:
    """Have a pipe hold more than the usual 64 KiB, where the system lets it be asked for."""
    if sys.platform == "linux":
        with suppress(OSError):
            fcntl.fcntl(pipe, fcntl.F_SETPIPE_SZ, PIPE_BYTES)


_initialized = threading.Lock()


def _log_once() -> None:
    """Have Zenoh log, from now on; it takes that once in a process."""
    if _initialized.acquire(blocking=False):
        zenoh.init_log_from_env_or(LOGGED)
