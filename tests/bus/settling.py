"""A network needs a moment to spread what was declared: waiting for it, on conditions."""

from __future__ import annotations

import itertools

from shared.bus.interface import Bus
from tests.waiting import wait_for

_probes = itertools.count()


def settle(publisher: Bus, subscriber: Bus) -> None:
    """Return once ``publisher`` reaches all that ``subscriber`` has subscribed to so far.

    Declarations travel in order: when a later one is in effect, so are the earlier.
    """
    key = f"probe/{next(_probes)}"
    heard: list[bytes] = []
    subscriber.subscribe(key, lambda received: heard.append(received.payload))

    def probe() -> bool:
        publisher.publish(key, b"")
        return bool(heard)

    wait_for(probe, "a subscription to take effect")
