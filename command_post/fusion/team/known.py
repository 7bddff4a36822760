"""When it was known where somebody was (pure)."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterator
from typing import NamedTuple


class Span(NamedTuple):
    """From ``begin_ns`` until ``end_ns``, both of them moments at which it was known."""

    begin_ns: int
    end_ns: int


class Known:
    """Moments, those close to each other as one span: the same spans in whichever order they came.

    In between those of a span it is held to be known all the time.
    """

    def __init__(self) -> None:
        self._begin_ns: list[int] = []
        self._end_ns: list[int] = []

    def add(self, time_ns: int, close_ns: int) -> bool:
        """Note that it was known then; ``False`` if that is no news.

        Moments no further apart than ``close_ns``, which is always the same, are close.
        """
        if self._end_ns and self._begin_ns[-1] <= time_ns <= self._end_ns[-1] + close_ns:
            # As a rule they come in the order of time, and go on with the last span.
            is_news = time_ns > self._end_ns[-1]
            self._end_ns[-1] = max(self._end_ns[-1], time_ns)
            return is_news
        first = bisect_right(self._end_ns, time_ns - close_ns - 1)
        end = bisect_right(self._begin_ns, time_ns + close_ns)
        if end - first == 1 and self._begin_ns[first] <= time_ns <= self._end_ns[first]:
            return False
        self._begin_ns[first:end], self._end_ns[first:end] = (
            [min([time_ns, *self._begin_ns[first:end]])],
            [max([time_ns, *self._end_ns[first:end]])],
        )
        return True

    def by(self, time_ns: int) -> int:
        """Return when, up to ``time_ns``, it was last known; 0 if never."""
        at = bisect_right(self._begin_ns, time_ns)
        return min(time_ns, self._end_ns[at - 1]) if at else 0

    def after(self, time_ns: int) -> Iterator[Span]:
        """Yield the spans after ``time_ns``, of the one that it is in what is left."""
        for at in range(bisect_right(self._end_ns, time_ns), len(self._end_ns)):
            yield Span(max(self._begin_ns[at], time_ns), self._end_ns[at])

    def forget(self, before_ns: int) -> None:
        """Drop the spans that ended before ``before_ns``, but for the last."""
        gone = min(bisect_right(self._end_ns, before_ns), len(self._end_ns) - 1)
        if gone > 0:
            del self._begin_ns[:gone], self._end_ns[:gone]
