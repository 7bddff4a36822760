"""A node that has gone mad: garbage and giant payloads under its own keys, as fast as it can.

``python -m tests.faults.flooder ENDPOINT INCIDENT ID SECONDS`` prints what it has sent, as JSON.
"""

from __future__ import annotations

import itertools
import json
import random
import sys
import time

import zenoh

from shared.bus.fair_inbox import LONGEST_HEARD_BYTES
from shared.bus.zenoh_settings import LONGEST_MESSAGE_BYTES
from shared.codec import MAX_PAYLOAD_BYTES

GIANT_EVERY = 500
"""One in so many is longer than anybody would hear."""


def flood(endpoint: str, incident: str, node_id: str, seconds: float) -> dict[str, float]:
    """Send for ``seconds``; return how much was sent, and how fast."""
    configuration = {
        "mode": "client",
        "connect": {"endpoints": [endpoint]},
        "scouting": {"multicast": {"enabled": False}, "gossip": {"enabled": False}},
    }
    chance = random.Random(1)  # noqa: S311
    garbage = [chance.randbytes(size) for size in (1, 40, 200, 400, 1500, MAX_PAYLOAD_BYTES + 9)]
    garbage += [b"\x81" * 30_000, b"\xdf\xff\xff\xff\xff" + b"\xa1a" * 200]
    giants = itertools.cycle(
        bytes(size) for size in (LONGEST_HEARD_BYTES + 1, LONGEST_MESSAGE_BYTES // 2, 5_000_000)
    )
    topics = ("increment", "alarm", "nonsense", "imu")
    keys = [f"clew/v1/{incident}/responder/{node_id}/{topic}" for topic in topics]
    with zenoh.open(zenoh.Config.from_json5(json.dumps(configuration))) as session:
        # Urgent, and never dropped on the way: the worst that it can do to others.
        publishers = [
            session.declare_publisher(
                key,
                congestion_control=zenoh.CongestionControl.BLOCK,
                priority=zenoh.Priority.REAL_TIME,
            )
            for key in keys
        ]
        began_s = time.monotonic()
        sent = size = 0
        while time.monotonic() - began_s < seconds:
            payload = next(giants) if sent % GIANT_EVERY == 0 else garbage[sent % len(garbage)]
            publishers[sent % len(publishers)].put(payload)
            sent += 1
            size += len(payload)
        lasted_s = time.monotonic() - began_s
    return {"sent": sent, "bytes": size, "per_s": sent / lasted_s}


if __name__ == "__main__":
    print(json.dumps(flood(sys.argv[1], sys.argv[2], sys.argv[3], float(sys.argv[4]))))  # noqa: T201
