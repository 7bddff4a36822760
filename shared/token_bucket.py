"""A token bucket: how much of a thing is allowed, at once and in the long run (pure)."""

from __future__ import annotations


class TokenBucket:
    """Allows ``burst`` at once, and ``per_s`` a second from then on.

    Times are seconds of any steady clock.
    """

    def __init__(self, per_s: float, burst: float, now_s: float) -> None:
        self._per_s = per_s
        self._burst = burst
        self._filled_s = now_s
        self._tokens = burst

    def holds(self, tokens: float, now_s: float) -> bool:
        """Say whether ``tokens`` could be taken at ``now_s``."""
        grown = self._tokens + max(0.0, now_s - self._filled_s) * self._per_s
        self._tokens = min(self._burst, grown)
        self._filled_s = now_s
        return self._tokens >= tokens

    def take(self, tokens: float, now_s: float) -> bool:
        """Take ``tokens`` out if they are there; say whether they were."""
        if not self.holds(tokens, now_s):
            return False
        self._tokens -= tokens
        return True
