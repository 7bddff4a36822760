"""What is told while an incident is taken up from its recording alone, which takes minutes.

Where people were is worth more than nothing: what was told last of everybody is told again and
again, as it was, with the time that it is of, until there is something newer.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Sequence

from command_post.resuming.resume import Made
from shared.codec import decode, parse_key
from shared.mcap_reader import RecordedMessage
from shared.messages import DapEstimate, TrackEstimate
from shared.topics import Key

AGAIN_S = 2.0
"""Who has to find the post again may have missed it."""


def last_told(recorded: Iterable[RecordedMessage]) -> list[Made]:
    """Return what was told last of where each responder and each DAP is."""
    found: dict[tuple[str, str], Made] = {}
    for log_time_ns, _, key_text, payload, outgoing in recorded:
        key = parse_key(key_text) if outgoing else None
        if not isinstance(key, Key) or key.topic not in {"track", "dap_place"}:
            continue
        match decode(key, payload):
            case TrackEstimate(responder_id=name) | DapEstimate(dap_id=name):
                found[(key.topic, name)] = Made(log_time_ns, key_text, payload)
    return list(found.values())


def telling(
    recorded: Iterable[RecordedMessage],
    told: Sequence[Made],
    say: Callable[[Sequence[Made]], object],
    monotonic_s: Callable[[], float] = time.monotonic,
) -> Iterator[RecordedMessage]:
    """Yield what is recorded, and ``say`` meanwhile every now and then what was ``told``."""
    next_s = monotonic_s()
    for each in recorded:
        if told and monotonic_s() >= next_s:
            say(told)
            next_s = monotonic_s() + AGAIN_S
        yield each
