"""Taking an incident up again after a kill: from its recording, by the very same handlers.

What had been handled and is not in the recording was never acknowledged to anybody, and comes
again. So an incident that is taken up goes on as its recording does: a replay of the whole makes
the same of it.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable
from typing import NamedTuple

from command_post.recorder.recorded import Incident as Handler
from shared.mcap_reader import RecordedMessage


class Made(NamedTuple):
    """What the incident says, and when it was made on the post's clock."""

    time_ns: int
    key: str
    payload: bytes


class Resumed(NamedTuple):
    """What came of handling again what was recorded.

    ``unrecorded`` was made of the last message and is not in the recording. ``differing`` counts
    what was made otherwise than it was recorded. ``last_ns`` is as of when anything
    was handled last.
    """

    handled: int
    unrecorded: list[Made]
    differing: int
    last_ns: int


def resume(
    recorded: Iterable[RecordedMessage],
    incident: Handler,
    recall: Callable[[str, bytes], None],
) -> Resumed:
    """Let ``incident`` handle all that was received of ``recorded``, what a recording has since.

    ``recall`` is told of each before.
    """
    made: deque[Made] = deque()
    handled = differing = last_ns = 0
    for log_time_ns, _, key, payload, outgoing in recorded:
        if outgoing:
            # It may have been made while nothing was heard.
            step = incident.pass_time(log_time_ns)
        else:
            handled += 1
            recall(key, payload)
            step = incident.handle(key, payload, log_time_ns)
        if step or not outgoing:
            differing += len(made)
            made = deque(Made(log_time_ns, each.key, each.payload) for each in step)
        last_ns = log_time_ns
        if outgoing:
            if made and made[0][1:] == (key, payload):
                made.popleft()
            else:
                differing += 1
    return Resumed(handled, list(made), differing, last_ns)
