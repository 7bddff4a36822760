"""What was heard on a bus, which all that is sent in a test must be: a message of its topic."""

from __future__ import annotations

from shared.bus.interface import Received
from shared.codec import Refusal, decode, parse_key
from shared.messages import Message


def message_in(received: Received) -> Message:
    """Return the message; what is refused fails the test."""
    key = parse_key(received.key)
    assert not isinstance(key, Refusal), key
    message = decode(key, received.payload)
    assert not isinstance(message, Refusal), message
    return message
