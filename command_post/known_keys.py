"""Keys as they were taken apart before: the same few come over and over (pure)."""

from __future__ import annotations

from shared.codec import Refusal, parse_key
from shared.topics import Key

MOST_KNOWN = 16_384


class KnownKeys:
    """Takes each key apart once, and keeps so many."""

    def __init__(self) -> None:
        self._known: dict[str, Key] = {}

    def parsed(self, key_text: str) -> Key | Refusal:
        """Return what ``parse_key`` makes of a key."""
        known = self._known.get(key_text)
        if known is not None:
            return known
        key = parse_key(key_text)
        if isinstance(key, Key):
            if len(self._known) >= MOST_KNOWN:
                self._known.clear()
            self._known[key_text] = key
        return key
