"""What the box can tell of itself: how much battery is left, how hot it is, why it goes off.

Whoever finds a DAP silent is to know what it was like before. Linux shows the battery under
``power_supply`` (``sysfs-class-power``), temperatures under ``thermal`` (``sysfs-class-thermal``).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

from shared.battery import POWER_SUPPLIES, read_battery, read_text
from shared.messages import MOST_WORDS, DapState
from shared.sender import Sender
from shared.units import NS_PER_S

THERMAL = Path("/sys/class/thermal")
PERIOD_NS = 10 * NS_PER_S
PLAUSIBLE_C = (-60.0, 250.0)
SWITCHED_OFF = "switched off"


class Box(NamedTuple):
    """Share of the battery that is left, and temperature; ``None`` where there is no telling."""

    battery_share: float | None
    temperature_c: float | None


def look_at_box(power: Path = POWER_SUPPLIES, thermal: Path = THERMAL) -> Box:
    """Return what Linux shows of the box: of several batteries the fullest, of zones the hottest.

    A driver that answers nothing, or nonsense, is passed over.
    """
    battery = read_battery(power)
    millidegrees = _numbers(thermal.glob("thermal_zone*/temp"))
    degrees_c = (each / 1000.0 for each in millidegrees)
    coldest_c, hottest_c = PLAUSIBLE_C
    return Box(
        None if battery is None else battery.battery,
        max((c for c in degrees_c if coldest_c <= c <= hottest_c), default=None),
    )


class BoxDesk:
    """Says what the box is like now and then, and why it goes off. To be used by one thread."""

    def __init__(
        self,
        sender: Sender,
        look: Callable[[], Box] = look_at_box,
        gone: Callable[[], Sequence[str]] = tuple,
    ) -> None:
        """``gone``: the names of the radios and sensors that are gone."""
        self._sender = sender
        self._look = look
        self._gone = gone
        self._due_ns = 0

    def pass_time(self, now_ns: int) -> None:
        """Note that it is ``now_ns``, as often as one likes."""
        if now_ns >= self._due_ns:
            self._due_ns = now_ns + PERIOD_NS
            self._say(now_ns, None)

    def go_off(self, now_ns: int, why: str) -> None:
        """Say that this DAP is heard no more from now on, and why."""
        self._say(now_ns, why[:MOST_WORDS])

    def _say(self, now_ns: int, going: str | None) -> None:
        box = self._look()
        worry = ", ".join(f"{name} is gone" for name in self._gone())[:MOST_WORDS]
        self._sender.send(
            DapState(
                event_time_ns=now_ns,
                sequence=self._sender.next_sequence(DapState),
                battery_share=box.battery_share,
                temperature_c=box.temperature_c,
                going=going,
                worry=worry or None,
            )
        )


def _numbers(paths: Iterator[Path]) -> Iterator[float]:
    for path in paths:
        with suppress(ValueError):
            yield float(read_text(path))
