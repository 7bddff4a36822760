"""What nodes have left, and when that is little (pure): a battery, a responder's air.

What is read goes up and down a little: it is little from a limit on, and no more from a higher one.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, NamedTuple, TypeAlias

from shared.messages import AlertKind, DapState, Supplies
from shared.topics import Role

Level: TypeAlias = Literal["enough", "low", "critical"]

EMPTY_BATTERY = 0.1
TOO_HOT_C = 70.0
"""Who falls silent having told so little charge, or so much heat, has probably died of it."""


class Limits(NamedTuple):
    """From ``low`` and ``critical`` down it is that, and from ``enough`` up no more."""

    low: float
    critical: float
    enough: float


BATTERY = Limits(0.20, 0.10, 0.25)
AIR_BAR = Limits(60.0, 30.0, 80.0)
"""A cylinder's whistle blows at 50 to 60 bar (EN 137)."""

AIR_LEFT_S = Limits(300.0, 120.0, 420.0)

_WORST_LAST: tuple[Level, ...] = ("enough", "low", "critical")


class Short(NamedTuple):
    """That something has become little, or littler; ``words`` are ``None`` once it is enough."""

    kind: AlertKind
    words: str | None


class SupplyWatch:
    """Follows what one node tells; tells each change for the worse, and that it is over."""

    def __init__(self) -> None:
        self._levels: dict[AlertKind, Level] = {"low_battery": "enough", "low_air": "enough"}

    def take(self, told: Supplies) -> list[Short]:
        """Take in what is left now; what is not told has not changed."""
        found = []
        if told.battery is not None:
            level = self._level("low_battery", ((told.battery, BATTERY),))
            level = "enough" if told.charging else level
            found += self._change("low_battery", level, f"battery at {told.battery:.0%}")
        air = [
            (value, limits)
            for value, limits in ((told.air_bar, AIR_BAR), (told.air_left_s, AIR_LEFT_S))
            if value is not None
        ]
        if air:
            found += self._change("low_air", self._level("low_air", air), air_words(told))
        return found

    def _level(self, kind: AlertKind, read: Sequence[tuple[float, Limits]]) -> Level:
        """Return how little the worst of what is read is, given how little it was."""
        levels = [_level_of(value, limits, self._levels[kind]) for value, limits in read]
        return max(levels, key=_WORST_LAST.index)

    def _change(self, kind: AlertKind, level: Level, words: str) -> list[Short]:
        before, self._levels[kind] = self._levels[kind], level
        if level == "enough":
            return [] if before == "enough" else [Short(kind, None)]
        worse = _WORST_LAST.index(level) > _WORST_LAST.index(before)
        return [Short(kind, words)] if worse else []


def _level_of(value: float, limits: Limits, before: Level) -> Level:
    if value <= limits.critical:
        return "critical"
    if before == "critical" and value < limits.enough:
        return "critical"
    if value <= limits.low or (before == "low" and value < limits.enough):
        return "low"
    return "enough"


def supplies_of(box: DapState) -> Supplies:
    """Return what a DAP told of its box as what it has left."""
    return Supplies(battery=box.battery_share, temperature_c=box.temperature_c)


def air_words(told: Supplies) -> str:
    """Return in words how much air is left."""
    parts = []
    if told.air_bar is not None:
        parts.append(f"air at {told.air_bar:.0f} bar")
    if told.air_left_s is not None:
        parts.append(f"air for {told.air_left_s / 60.0:.0f} min")
    return ", ".join(parts)


def short_of(told: Supplies | None) -> tuple[str, ...]:
    """Return in words what somebody has little of."""
    if told is None:
        return ()
    found = []
    if told.battery is not None and told.battery <= BATTERY.low and not told.charging:
        found.append(f"battery at {told.battery:.0%}")
    air = ((told.air_bar, AIR_BAR.low), (told.air_left_s, AIR_LEFT_S.low))
    if any(value is not None and value <= low for value, low in air):
        found.append(air_words(told))
    return tuple(found)


def why_silent(role: Role, told: Supplies | None) -> str | None:
    """Return what a node probably fell silent of, by what it told last; ``None`` if unknown."""
    battery, hot_c = (None, None) if told is None else (told.battery, told.temperature_c)
    if battery is not None and battery <= EMPTY_BATTERY and told is not None and not told.charging:
        return f"its battery was at {battery:.0%}"
    if hot_c is not None and hot_c >= TOO_HOT_C:
        return f"it was at {hot_c:.0f} °C"
    return "its link is lost, or it has failed" if role == "dap" else None
