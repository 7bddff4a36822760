"""Radios by their name on the command line: ``KIND:WHERE``.

A kind's module is imported when one is opened: it may need what others do without.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path

from shared.radios.live import SCAN_RATE_HZ, LiveSource, PolledSource
from shared.radios.readings import RadioScan, ScannerError

RADIOS = ("nl80211:INTERFACE", "hostapd:SOCKET", "wpa:SOCKET", "ble:ADAPTER")


def is_radio(name: str) -> bool:
    """Say whether ``name`` is of a radio's kind, whether or not it can be opened."""
    return name.startswith(tuple(kind.partition(":")[0] + ":" for kind in RADIOS))


def open_radios(
    names: Sequence[str], option: str, others: Sequence[str] = (), rate_hz: float = SCAN_RATE_HZ
) -> list[LiveSource[RadioScan]]:
    """Open ``nl80211:INTERFACE``, ``hostapd:SOCKET`` and the like, as many as are named.

    ``rate_hz``: how often a Wi-Fi radio is asked. Raises ``ScannerError`` for what is not there,
    and for a name that is none; ``option`` gave it, and takes ``others`` too, one at a time.
    """
    return [_open(name, option, others, rate_hz) for name in names]


def _open(name: str, option: str, others: Sequence[str], rate_hz: float) -> LiveSource[RadioScan]:
    kind, _, where = name.partition(":")
    if where and kind == "nl80211":
        from shared.radios.nl80211 import Nl80211Radio  # noqa: PLC0415

        return PolledSource(name, partial(Nl80211Radio, where), rate_hz)
    if where and kind == "hostapd":
        from shared.radios.hostapd import HostapdRadio  # noqa: PLC0415

        return PolledSource(name, partial(HostapdRadio, Path(where)), rate_hz)
    if where and kind == "wpa":
        from shared.radios.wpa import WpaRadio  # noqa: PLC0415

        return PolledSource(name, partial(WpaRadio, Path(where)), rate_hz)
    if where and kind == "ble":
        from shared.radios.ble import BleSource, open_bluetooth  # noqa: PLC0415

        return BleSource(name, open_bluetooth(where), rate_hz)
    if where and any(other.startswith(f"{kind}:") for other in others):
        raise ScannerError(f"{option} {name}: give no other beside it, it is played")
    *first, last = (*RADIOS, *others)
    raise ScannerError(
        f"{option} {name!r}: write {', '.join(first)} or {last}, as in nl80211:wlan0"
    )
