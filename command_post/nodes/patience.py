"""How much that is of no use is taken from one sender, and kept as evidence of it (pure).

What cannot be decoded, or is turned away, costs the time to look at it and room on the disk. A
little of it is worth both: it shows what is wrong. Of a flood the first is as good as the last.
"""

from __future__ import annotations

from collections import Counter

from shared.token_bucket import TokenBucket

BURST_MESSAGES = 1000
MESSAGES_PER_S = 10.0
BURST_BYTES = 1 << 20
BYTES_PER_S = 4096.0
"""Of one sender; in the long run that is 350 MB a day."""

BURST_BYTES_IN_ALL = 16 << 20
BYTES_PER_S_IN_ALL = 32_768.0

MOST_SENDERS = 4096
"""Further ones share what the unknown may send."""

UNNAMED = "?"


class Patience:
    """What each sender may still send that is of no use.

    ``useless`` counts what they sent of the kind; ``only_counted`` what of it came when there was
    no patience left.
    """

    def __init__(self, now_s: float) -> None:
        """Times are seconds of any steady clock."""
        self._in_all = TokenBucket(BYTES_PER_S_IN_ALL, BURST_BYTES_IN_ALL, now_s)
        self._accounts: dict[str, _Account] = {}
        self.useless: Counter[str] = Counter()
        self.only_counted: Counter[str] = Counter()

    def bears(self, sender: str, size: int, now_s: float) -> bool:
        """Say whether a useless message of ``size`` bytes from ``sender`` would be borne."""
        account = self._accounts.get(self._named(sender))
        return account is None or (
            account.messages.holds(1.0, now_s)
            and account.bytes.holds(size, now_s)
            and self._in_all.holds(size, now_s)
        )

    def charge(self, sender: str, size: int, now_s: float) -> bool:
        """Charge ``sender`` for a useless message of ``size`` bytes; say whether it was borne."""
        named = self._named(sender)
        self.useless[named] += 1
        account = self._accounts.get(named)
        if account is None:
            account = self._accounts[named] = _Account(now_s)
        if not self.bears(named, size, now_s):
            return False
        account.messages.take(1.0, now_s)
        account.bytes.take(size, now_s)
        return self._in_all.take(size, now_s)

    def count(self, sender: str) -> None:
        """Count a message that was not even kept."""
        named = self._named(sender)
        self.useless[named] += 1
        self.only_counted[named] += 1

    def _named(self, sender: str) -> str:
        known = sender in self._accounts or len(self._accounts) < MOST_SENDERS
        return sender if known else UNNAMED


class _Account:
    """What one sender may still send."""

    def __init__(self, now_s: float) -> None:
        self.messages = TokenBucket(MESSAGES_PER_S, BURST_MESSAGES, now_s)
        self.bytes = TokenBucket(BYTES_PER_S, BURST_BYTES, now_s)
