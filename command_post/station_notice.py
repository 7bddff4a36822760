"""Whose radio is whose, told to those who hear radios: at first, to whoever comes, now and then."""

from __future__ import annotations

from msgspec import structs

from shared.messages import StationTable

LEAST_PAUSE_S = 2.0
"""Of many who come at once, all are told by one notice."""

REPEAT_S = 30.0


class StationNotice:
    """Knows when the table is due to be said again. Without a table nothing ever is."""

    def __init__(self, table: StationTable | None) -> None:
        self._table = table
        self._awaited = False
        self._said_s: float | None = None
        self._said = 0

    def due(self, real_s: float, now_ns: int, *, some_came: bool) -> StationTable | None:
        """Return what is to be said now, if anything is; ``sequence`` 0 is the first.

        ``real_s`` is a count of real seconds, ``some_came`` whether anybody came since this was
        last asked.
        """
        self._awaited = self._awaited or some_came
        if self._table is None:
            return None
        if self._said_s is not None:
            since_s = real_s - self._said_s
            if since_s < LEAST_PAUSE_S or not (self._awaited or since_s >= REPEAT_S):
                return None
        self._awaited, self._said_s = False, real_s
        self._said += 1
        return structs.replace(self._table, event_time_ns=now_ns, sequence=self._said - 1)
