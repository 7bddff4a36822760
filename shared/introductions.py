"""Nodes make themselves known: each shows its certificate, and asks for those it has not seen.

A certificate speaks for itself, so it does not matter who hands it on.
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
from shared.topics import certificate_key

POLL_S = 0.2
ASK_TIMEOUT_S = 1.0
ASK_AGAIN_S = 3.0
"""Who did not answer is asked again so much later."""

MOST_ASKED = 4096

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
        self._asked_s: OrderedDict[Identity, float] = OrderedDict()
        self._stop = threading.Event()
        # No daemon: it is inside Zenoh when it asks.
        self._thread = threading.Thread(target=self._run, name="introductions", daemon=False)
        self.signers: KnownSigners | None = None
        if bundle is not None:
            self.signers = KnownSigners(bundle.authority, now_ns, bundle.nodes.withdrawn)
            self.signers.learn(bundle.identity, bundle.certificate.der)

    def __enter__(self) -> Self:
        if self._bundle is not None:
            role, node_id = self._bundle.identity
            shown = self._bundle.certificate.der
            self._bus.answer(certificate_key(self._incident, role, node_id), lambda _: shown)
            self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        if self._thread.ident is not None:
            self._thread.join()

    def meet(self, node: Identity) -> None:
        """Ask a node for its certificate, and wait for the answer."""
        if self.signers is None:
            return
        key = certificate_key(self._incident, *node)
        for received in self._bus.query(key, ASK_TIMEOUT_S):
            why = self.signers.learn(node, received.payload)
            if why is not None and self.signers.refused[why, node.node_id] == 1:
                _log.warning("a certificate is of no use", reason=why, node_id=node.node_id)

    def _run(self) -> None:
        while not self._stop.wait(POLL_S):
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
