"""The box's own accelerometer, as Linux's Industrial I/O shows it.

``in_accel_x_raw`` and its like, plus ``in_accel_offset``, times ``in_accel_scale``, are m/s² (the
kernel's ``sysfs-bus-iio``); scale and offset may be each axis's own. At rest it reads +g upwards.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from threading import Event

import structlog

from dap_node.scanners.observation import Motion
from shared.messages import Vector3
from shared.radios.live import TRY_AGAIN_S
from shared.radios.readings import ScannerError

DEVICES = Path("/sys/bus/iio/devices")
RATE_HZ = 25.0
SAMPLES_AT_ONCE = 5
AXES = ("x", "y", "z")

_log = structlog.stdlib.get_logger(__name__)


class IioAccelerometer:
    """A source that reads the accelerometer ``iio:N`` steadily."""

    def __init__(self, name: str, rate_hz: float = RATE_HZ) -> None:
        """Raise ``ScannerError`` where there is none, or it cannot be read."""
        kind, _, number = name.partition(":")
        if kind != "iio" or not number.isdecimal():
            raise ScannerError(f"--accelerometer {name!r}: write iio:NUMBER, as in iio:0")
        self._name = name
        self._folder = DEVICES / f"iio:device{number}"
        self._period_s = 1.0 / rate_hz
        self._is_away = False
        try:
            self._calibration = [self._scale_and_offset(axis) for axis in AXES]
            self._read()
        except (OSError, ValueError) as error:
            raise ScannerError(f"{name}: no accelerometer to be read there: {error}") from None

    @property
    def name(self) -> str:
        """What the command line calls it."""
        return self._name

    @property
    def is_away(self) -> bool:
        """Whether it is gone, and looked for."""
        return self._is_away

    def listen(
        self, deliver: Callable[[Motion], None], now_ns: Callable[[], int], stop: Event
    ) -> None:
        """Deliver what it reads, a few samples at once, until ``stop`` is set."""
        gathered: list[tuple[int, Vector3]] = []
        due_s = time.monotonic()
        while not stop.wait(max(due_s - time.monotonic(), 0.0)):
            try:
                gathered.append((now_ns(), self._read()))
            except (OSError, ValueError) as error:
                if not self._is_away:
                    _log.error("the accelerometer fails", source=self._name, why=str(error))
                self._is_away, due_s = True, time.monotonic() + TRY_AGAIN_S
                continue
            self._is_away, due_s = False, max(due_s + self._period_s, time.monotonic())
            if len(gathered) >= SAMPLES_AT_ONCE:
                deliver(Motion(gathered[-1][0], tuple(gathered)))
                gathered = []

    def _read(self) -> Vector3:
        x, y, z = (
            scale * (self._number(f"in_accel_{axis}_raw") + offset)
            for axis, (scale, offset) in zip(AXES, self._calibration, strict=True)
        )
        return x, y, z

    def _scale_and_offset(self, axis: str) -> tuple[float, float]:
        own, common = f"in_accel_{axis}_", "in_accel_"
        has_own = (self._folder / f"{own}scale").exists()
        scale = self._number(f"{own if has_own else common}scale")
        for prefix in (own, common):
            if (self._folder / f"{prefix}offset").exists():
                return scale, self._number(f"{prefix}offset")
        return scale, 0.0

    def _number(self, file: str) -> float:
        return float((self._folder / file).read_text())
