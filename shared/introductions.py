"""Nodes make themselves known: each shows its certificate, and asks for those it has not seen.

Whoever asks a post for its certificate shows its own in the question. A certificate speaks for
itself, so it does not matter who hands it on.
"""

from __future__ import annotations

import threading
import time
from collections import OrderedDict
from collections.abc import Callable
from typing import Self

import structlog

from shared.bus.interface import Bus
from shared.messages import NodeId
from shared.security.bundle import Bundle
from shared.security.certificates import Identity
from shared.security.verifier import KnownSigners
from shared.token_bucket import TokenBucket
from shared.topics import ROLES, certificate_key

POLL_S = 0.2
ASK_TIMEOUT_S = 1.0
ASK_AGAIN_S = 3.0
"""Who did not answer is asked again so much later."""

MOST_ASKED = 4096
MOST_AT_ONCE, MOST_PER_S = 1000.0, 100.0
"""Introductions that are looked into: who is missed is asked later, when something is heard."""

_log = structlog.stdlib.get_logger(__name__)


class Introductions:
    """Answers for a node's own certificate and, on a thread of its own, asks for others'.

    ``signers`` are those who are known by then, for a ``Gate``. Without a bundle nobody has a
    certificate: ``signers`` is ``None``, and nothing is done.
    """

    def __init__(
        self,
        bus: Bus,
        incident: NodeId,
        bundle: Bundle | None,
        now_ns: Callable[[], int] = time.time_ns,
    ) -> None:
        """``now_ns``: the clock by which certificates count."""
        self._bus = bus
        self._incident = incident
        self._bundle = bundle
        self._lock = threading.Lock()
        self._asked_s: OrderedDict[Identity, float] = OrderedDict()
        self._looked_into = TokenBucket(MOST_PER_S, MOST_AT_ONCE, time.monotonic())
        self._stop = threading.Event()
        # No daemon: it is inside Zenoh when it asks.
        self._thread = threading.Thread(target=self._run, name="introductions", daemon=False)
        self.signers: KnownSigners | None = None
        if bundle is not None:
            self.signers = KnownSigners(bundle.authority, now_ns, bundle.nodes.withdrawn)
            self.signers.learn(bundle.certificate.der)

    def __enter__(self) -> Self:
        if self._bundle is not None:
            own = certificate_key(self._incident, *self._bundle.identity)
            self._bus.answer(own, self._show)
            self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        if self._thread.ident is not None:
            self._thread.join()
        refused = {} if self.signers is None else self.signers.refused
        for (reason, node_id), count in sorted(refused.items()):
            _log.warning(
                "certificates of no use in all", reason=reason, shown_as=node_id, count=count
            )

    def introduce(self) -> bool:
        """Show the posts who this is, and learn who they are; say whether one answered."""
        return self._bundle is None or self._ask(
            Identity("post", "*"), self._bundle.certificate.der
        )

    def meet(self, node: Identity) -> bool:
        """Ask a node for its certificate; say whether it has shown one that is of use."""
        return self._bundle is None or self._ask(node, b"")

    def _ask(self, whom: Identity, showing: bytes) -> bool:
        key = certificate_key(self._incident, *whom)
        replies = self._bus.query(key, ASK_TIMEOUT_S, showing)
        # All of them: no impostor's answer is to hide the true one.
        learnt = [self._learn(each.payload, node_of(each.key)) for each in replies]
        return any(learnt)

    def _show(self, request: bytes) -> bytes | None:
        if self._bundle is None:
            return None
        if request and self._looked_into.take(1.0, time.monotonic()):
            self._learn(request, None)
        return self._bundle.certificate.der

    def _learn(self, der: bytes, shown_as: Identity | None) -> bool:
        if self.signers is None:
            return False
        with self._lock:
            before = len(self.signers.refused)
            why = self.signers.learn(der, shown_as)
            is_new = len(self.signers.refused) > before
        if is_new:
            node_id = None if shown_as is None else shown_as.node_id
            _log.warning("a certificate is of no use", reason=why, shown_as=node_id)
        return why is None

    def _run(self) -> None:
        introduced = False
        while not self._stop.wait(POLL_S):
            introduced = introduced or self.introduce()
            for node in () if self.signers is None else self.signers.take_wanted():
                if self._stop.is_set():
                    return
                if self._may_ask(node):
                    self.meet(node)

    def _may_ask(self, node: Identity) -> bool:
        now_s = time.monotonic()
        if now_s - self._asked_s.get(node, -ASK_AGAIN_S) < ASK_AGAIN_S:
            return False
        self._asked_s[node] = now_s
        self._asked_s.move_to_end(node)
        if len(self._asked_s) > MOST_ASKED:
            self._asked_s.popitem(last=False)
        return True


def node_of(key: str) -> Identity | None:
    """Return whose key it is; ``None`` for one that is not ours."""
    chunks = key.split("/")
    role = next((known for known in ROLES if chunks[3:4] == [known]), None)
    return Identity(role, chunks[4]) if role is not None and len(chunks) > 4 else None
