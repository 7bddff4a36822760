"""What a post answers to whoever asks something of it."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TypeVar

from shared.bus.inbox import Inbox
from shared.bus.interface import Bus, Received
from shared.codec import Refusal, decode, parse_key
from shared.gate import Gate
from shared.messages import Message
from shared.sender import Sender
from shared.topics import Key

POLL_S = 0.05
MOST_ANSWERS = 64

_Answer = TypeVar("_Answer", bound=Message)


def answered(
    bus: Bus, request: Message, sender: Sender, gate: Gate, kind: type[_Answer], within_s: float,
    fits: Callable[[Key, _Answer], bool],
) -> _Answer | None:  # fmt: skip
    """Send a request; return the first message of ``kind`` that ``fits``.

    ``fits`` is asked of what some post says and the gate lets in; ``None`` if none does
    ``within_s``.
    """
    answers: Inbox[Received] = Inbox(MOST_ANSWERS)
    bus.subscribe(sender.key(kind, "*"), answers.put)
    sender.send(request)
    give_up_s = time.monotonic() + within_s
    while time.monotonic() < give_up_s:
        for received in answers.get_all(POLL_S):
            key = parse_key(received.key)
            if isinstance(key, Refusal) or gate.admit(*received) is not None:
                continue
            answer = decode(key, received.payload)
            if isinstance(answer, kind) and fits(key, answer):
                return answer
    return None
