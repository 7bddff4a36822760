"""What is told while an incident is taken up from its recording alone, which takes minutes.

Where people were is worth more than nothing: what was told last of everybody is told again and
again, as it was, with the time that it is of, until there is something newer.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Sequence

from command_post.resuming.resume import Made
from shared.mcap_reader import RecordedMessage

AGAIN_S = 2.0
"""Who has to find the post again may have missed it."""


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
