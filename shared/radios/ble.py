"""A Bluetooth adapter that listens for advertisements."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable
from contextlib import AbstractAsyncContextManager
from pathlib import Path
from threading import Event
from typing import Any, NamedTuple, TypeAlias

import structlog

from shared.radios.ble_advertisements import reading_of
from shared.radios.live import SCAN_RATE_HZ, TRY_AGAIN_S
from shared.radios.readings import RadioScan, Reading, ScannerError

ADAPTERS = Path("/sys/class/bluetooth")

Deliver: TypeAlias = Callable[[RadioScan], None]

Heed: TypeAlias = Callable[[Any, Any], None]
"""Is given a device and its advertisement, as bleak has them."""

Listening: TypeAlias = AbstractAsyncContextManager[Any]

_log = structlog.stdlib.get_logger(__name__)


class Bluetooth(NamedTuple):
    """How to listen with an adapter, what that raises when it fails, and if it is there at all."""

    listen: Callable[[Heed], Listening]
    failures: tuple[type[Exception], ...]
    is_there: Callable[[], bool]


class BleSource:
    """Advertisements that an adapter hears, gathered into scans. One that goes is waited for."""

    def __init__(
        self,
        name: str,
        bluetooth: Bluetooth,
        rate_hz: float = SCAN_RATE_HZ,
        *,
        try_again_s: float = TRY_AGAIN_S,
    ) -> None:
        self._name = name
        self._bluetooth = bluetooth
        self._period_s = 1.0 / rate_hz
        self._try_again_s = try_again_s
        self._heard: list[tuple[int, Reading]] = []
        self._is_away = False

    @property
    def name(self) -> str:
        """What the command line calls it."""
        return self._name

    @property
    def is_away(self) -> bool:
        """Whether it is gone, and looked for."""
        return self._is_away

    def listen(self, deliver: Deliver, now_ns: Callable[[], int], stop: Event) -> None:
        """Deliver a scan a period, until ``stop`` is set."""
        asyncio.run(self._listen(deliver, now_ns, stop))

    async def _listen(self, deliver: Deliver, now_ns: Callable[[], int], stop: Event) -> None:
        while not stop.is_set():
            try:
                async with self._bluetooth.listen(self._heed):
                    await self._gather(deliver, now_ns, stop)
            except self._bluetooth.failures as error:
                self._tell_away(str(error))
                await asyncio.sleep(self._try_again_s)

    async def _gather(self, deliver: Deliver, now_ns: Callable[[], int], stop: Event) -> None:
        """Deliver what is heard while the adapter is there; ``OSError`` once it is not."""
        while not stop.is_set():
            await asyncio.sleep(self._period_s)
            # Bluetooth's service falls silent, and says nothing, when its adapter is pulled out.
            if not self._bluetooth.is_there():
                raise OSError("the adapter is not there")
            if self._is_away:
                self._is_away = False
                _log.warning("the radio is back", source=self._name)
            heard, self._heard = self._heard, []
            at_ns = time.monotonic_ns()
            deliver(
                RadioScan(
                    now_ns(),
                    tuple(reading._replace(age_ns=at_ns - heard_ns) for heard_ns, reading in heard),
                )
            )

    def _heed(self, device: Any, advertisement: Any) -> None:
        reading = reading_of(
            device.address,
            advertisement.rssi,
            advertisement.manufacturer_data,
            advertisement.service_uuids,
        )
        if reading is not None:
            self._heard.append((time.monotonic_ns(), reading))

    def _tell_away(self, why: str) -> None:
        if not self._is_away:
            self._is_away = True
            _log.error("the radio is gone: it is looked for", source=self._name, why=why)


def open_bluetooth(adapter: str) -> Bluetooth:
    """Return how to listen with ``adapter``, as in ``hci0``.

    Raises ``ScannerError`` where there is none of that name, or no bleak to use it.
    """
    try:
        from bleak import BleakScanner  # noqa: PLC0415
        from bleak.exc import BleakError  # noqa: PLC0415
    except ImportError as error:
        raise ScannerError(f"ble: bleak is missing ({error}); install 'clew[ble]'") from None
    there = ADAPTERS / adapter
    if not there.exists():
        known = ", ".join(sorted(path.name for path in ADAPTERS.glob("*"))) or "none"
        raise ScannerError(f"ble:{adapter}: no such adapter; there are: {known}")

    def listen(heed: Heed) -> Listening:
        # Without duplicates the service tells of a device anew only when it changed by much.
        bluez: Any = {"adapter": adapter, "filters": {"DuplicateData": True}}
        return BleakScanner(heed, bluez=bluez)

    return Bluetooth(listen, (BleakError, OSError, EOFError), there.exists)
