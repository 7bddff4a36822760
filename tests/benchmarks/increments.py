"""A stream of realistic increments, and a process that publishes it as fast as it is taken."""

from __future__ import annotations

import sys

from shared.bus.inbox import Inbox
from shared.bus.interface import Bus, Received
from shared.bus.zenoh_bus import open_zenoh
from shared.codec import encode
from shared.messages import OdometryIncrement
from shared.process import stop_on_signals, stop_with_parent

KEY = "clew/v1/benchmark/responder/r1/increment"
SEND_KEY = "benchmark/send"
TAKEN_KEY = "benchmark/taken"
READY_KEY = "benchmark/ready"

WINDOW = 200
"""Increments on their way at once: less than one of the two 64 kB batches that a link queues, so
that congestion control DROP, as in the field, has nothing to drop."""

ACKNOWLEDGED_EACH = 50


def increment(sequence: int) -> OdometryIncrement:
    """Return a stride as a boot gives it, the same but for its number and times."""
    return OdometryIncrement(
        event_time_ns=1_750_000_000_123_456_789 + sequence * 1_070_000_000,
        sequence=sequence,
        start_time_ns=1_750_000_000_123_456_789 + (sequence - 1) * 1_070_000_000,
        d_north_m=1.1873642,
        d_east_m=-0.3127465,
        d_down_m=0.0041239,
        d_heading_rad=-0.0213785,
        heading_rad=1.2078364,
        covariance=(
            1.2e-4, 3.1e-6, -2.2e-7, 1.4e-6, 1.3e-4, 1.9e-7, -2.4e-6, 8.8e-5, 3.0e-8, 6.5e-6,
        ),
        mount="boot",
    )  # fmt: skip


def publish(bus: Bus, count: int, inbox: Inbox[Received]) -> None:
    """Publish ``count`` increments, never more than ``WINDOW`` ahead of the subscriber."""
    acknowledged = 0
    for sequence in range(count):
        while sequence - acknowledged >= WINDOW:
            receipt = inbox.get(1.0)
            if receipt is not None:
                acknowledged = int(receipt.payload)
        bus.publish(KEY, encode(increment(sequence)), "high")


def main() -> None:
    """Publish as many as are asked for under ``SEND_KEY``, until stopped."""
    inbox: Inbox[Received] = Inbox(1000)
    with stop_on_signals() as stop, open_zenoh("client", connect=sys.argv[1:]) as bus:
        stop_with_parent(stop)
        # One subscription, so that the receipts of one run stay before the order for the next.
        bus.subscribe("benchmark/*", inbox.put)
        bus.declare_alive(READY_KEY)
        while not stop.is_set():
            received = inbox.get(0.1)
            if received is not None and received.key == SEND_KEY:
                publish(bus, int(received.payload), inbox)


if __name__ == "__main__":
    main()
