"""Radios as they are heard, each on a thread of its own."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from threading import Event, Thread
from typing import Protocol, TypeVar

import structlog

from shared.bus.inbox import Inbox
from shared.radios.readings import RadioScan, ScannerError
from shared.radios.station_counters import Polled, StationCounters

SCAN_RATE_HZ = 5.0
TRY_AGAIN_S = 1.0
"""When a radio that is gone is looked for again."""

MOST_WAITING = 256

T = TypeVar("T")
T_co = TypeVar("T_co", covariant=True)

_log = structlog.stdlib.get_logger(__name__)


class LiveSource(Protocol[T_co]):
    """A radio that is listened to, or another sensor."""

    @property
    def name(self) -> str:
        """What the command line calls it, as in ``nl80211:wlan0``."""

    @property
    def is_away(self) -> bool:
        """Whether it is gone, and looked for."""

    def listen(
        self, deliver: Callable[[T_co], None], now_ns: Callable[[], int], stop: Event
    ) -> None:
        """Deliver what there is whenever there is something, until ``stop`` is set."""


class Radio(Protocol):
    """An open radio that can be asked for all its stations."""

    def poll(self) -> Iterable[Polled]:
        """Return what is known of each station; ``OSError`` when the radio is gone."""

    def close(self) -> None:
        """Let go of it."""


class PolledSource:
    """Asks a radio for its stations steadily. One that goes is waited for, and said."""

    def __init__(
        self,
        name: str,
        open_radio: Callable[[], Radio],
        rate_hz: float = SCAN_RATE_HZ,
        *,
        try_again_s: float = TRY_AGAIN_S,
    ) -> None:
        """Open the radio, so that one that is not there is told at once.

        ``open_radio`` raises ``ScannerError`` or ``OSError``.
        """
        self._name = name
        self._open_radio = open_radio
        self._period_s = 1.0 / rate_hz
        self._try_again_s = try_again_s
        self._radio: Radio | None = open_radio()

    @property
    def name(self) -> str:
        """What the command line calls it."""
        return self._name

    @property
    def is_away(self) -> bool:
        """Whether it is gone, and looked for."""
        return self._radio is None

    def listen(
        self, deliver: Callable[[RadioScan], None], now_ns: Callable[[], int], stop: Event
    ) -> None:
        """Deliver a scan a period, until ``stop`` is set."""
        counters = StationCounters()
        due_s = time.monotonic()
        try:
            while not stop.wait(max(due_s - time.monotonic(), 0.0)):
                polled = self._polled()
                if polled is None:
                    counters.forget()
                    due_s = time.monotonic() + self._try_again_s
                    continue
                deliver(RadioScan(now_ns(), counters.readings(polled)))
                # What was missed while the machine was busy is not made up for.
                due_s = max(due_s + self._period_s, time.monotonic())
        finally:
            self._close()

    def _polled(self) -> list[Polled] | None:
        """Return what the radio knows of its stations; ``None`` while it is away."""
        try:
            if self._radio is None:
                self._radio = self._open_radio()
                _log.warning("the radio is back", source=self._name)
            return list(self._radio.poll())
        except (OSError, ScannerError) as error:
            if self._radio is not None:
                _log.error("the radio is gone: it is looked for", source=self._name, why=str(error))
            self._close()
            return None

    def _close(self) -> None:
        radio, self._radio = self._radio, None
        if radio is not None:
            radio.close()


def gathered(
    sources: Sequence[LiveSource[T]], now_ns: Callable[[], int], stop: Event, tick_s: float
) -> Iterator[T | None]:
    """Yield what all ``sources`` deliver, as it comes, until ``stop`` is set.

    ``None`` after each ``tick_s`` without any. Raises what a source raises that cannot go on.
    """
    inbox: Inbox[T] = Inbox(MOST_WAITING)
    ended = Event()
    failures: list[BaseException] = []

    def listen(source: LiveSource[T]) -> None:
        try:
            source.listen(inbox.put, now_ns, ended)
        except BaseException as error:
            failures.append(error)

    threads = [
        Thread(target=listen, args=(source,), name=source.name, daemon=True) for source in sources
    ]
    for thread in threads:
        thread.start()
    try:
        while not stop.is_set():
            heard = inbox.get(tick_s)
            if failures:
                raise failures[0]
            yield heard
    finally:
        ended.set()
        for thread in threads:
            thread.join(2.0 * TRY_AGAIN_S)
