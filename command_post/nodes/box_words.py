"""What a DAP told of itself, in words for a commander (pure)."""

from __future__ import annotations

from collections.abc import Iterator

from shared.messages import DapState
from shared.units import NS_PER_S

LOW_SHARE = 0.2
HOT_C = 70.0
SILENT_NS = 10 * NS_PER_S
"""A DAP beats twice a second: one that is not heard for so long is dead, or out of reach."""


def box_words(state: DapState | None, silent_ns: int) -> Iterator[str]:
    """Yield what is to be told of a box: why it is dead, if it is; else what may come.

    ``silent_ns`` is for how long nothing was heard of it. None where it is well, or never said.
    """
    if state is None:
        return
    worries = [*_worries(state)]
    if state.going is not None:
        yield ", ".join([f"went off: {state.going}", *worries])
    elif silent_ns >= SILENT_NS and worries:
        yield f"fell silent, last {', '.join(worries)}"
    elif silent_ns >= SILENT_NS:
        yield f"fell silent without a word: out of reach, or destroyed ({_well(state)} before)"
    else:
        yield from worries


def _worries(state: DapState) -> Iterator[str]:
    if state.battery_share is not None and state.battery_share <= LOW_SHARE:
        yield f"battery at {state.battery_share:.0%}"
    if state.temperature_c is not None and state.temperature_c >= HOT_C:
        yield f"{state.temperature_c:.0f} °C hot"
    if state.worry is not None:
        yield state.worry


def _well(state: DapState) -> str:
    known = []
    if state.battery_share is not None:
        known.append(f"battery at {state.battery_share:.0%}")
    if state.temperature_c is not None:
        known.append(f"{state.temperature_c:.0f} °C")
    return ", ".join(known) or "all was well"
