"""In what the settings differ that two recordings were made with."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress

import msgspec

MOST_DETAIL = 40


def differences(then: Mapping[str, str], now: Mapping[str, str]) -> list[str]:
    """Say in what two recordings' metadata differ; what is JSON, field by field."""
    before, after = (_flat({name: each.get(name) for name in now}) for each in (then, now))
    return [
        f"{name} {_briefly(before.get(name))}, not {_briefly(after.get(name))}"
        for name in {**before, **after}
        if before.get(name) != after.get(name)
    ]


def _flat(fields: Mapping[str, object], within: str = "") -> dict[str, object]:
    found: dict[str, object] = {}
    for name, value in fields.items():
        told = value
        if isinstance(value, str):
            with suppress(msgspec.DecodeError):
                told = msgspec.json.decode(value)
        if isinstance(told, dict):
            # What the settings are all in need not be named.
            found |= _flat(told, f"{within}{name}." if told is value else within)
        else:
            found[within + name] = value
    return found


def _briefly(value: object) -> str:
    return "unknown" if value is None else str(value)[:MOST_DETAIL]
