"""Sources by their name on the command line: ``KIND:WHERE``.

A kind's module is imported when one is opened: a DAP that listens to a radio has no use for what
simulating takes, nor room for it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Protocol, runtime_checkable

from dap_node.scanners.live import SCAN_RATE_HZ, LiveSource, PolledSource
from dap_node.scanners.observation import Observation, ScannerError
from shared.messages import NodeId

LIVE, PLAYED = ("nl80211", "hostapd", "ble"), ("recorded", "simulated")
FORMS = (
    "nl80211:INTERFACE, hostapd:SOCKET, ble:ADAPTER, recorded:FILE or simulated:SCENARIO, as in "
    "nl80211:wlan0"
)


@runtime_checkable
class Playable(Protocol):
    """Observations that are known beforehand."""

    def observations(self, start_ns: int) -> Iterator[Observation]:
        """Yield them in the order of time, counted from ``start_ns``."""


def open_played(name: str, dap_id: NodeId, seed: int) -> Playable | None:
    """Open ``recorded:FILE`` or ``simulated:SCENARIO``; ``None`` for another kind.

    Raises ``ScannerError`` for a file that cannot be used, ``ValueError`` for a scenario.
    """
    kind, where = _taken_apart(name)
    if kind == "recorded":
        from dap_node.scanners.recorded import RecordedScanner  # noqa: PLC0415

        return RecordedScanner(Path(where))
    if kind == "simulated":
        from dap_node.scanners.simulated import SimulatedScanner  # noqa: PLC0415
        from shared.simulation.scenario import load_scenario  # noqa: PLC0415

        return SimulatedScanner(load_scenario(where), dap_id, seed)
    return None


def open_live(names: Sequence[str], rate_hz: float = SCAN_RATE_HZ) -> list[LiveSource]:
    """Open ``nl80211:INTERFACE``, ``hostapd:SOCKET`` and ``ble:ADAPTER``, as many as are named.

    ``rate_hz``: how often a Wi-Fi radio is asked. Raises ``ScannerError`` for what is not there.
    """
    return [_open_live(name, rate_hz) for name in names]


def _open_live(name: str, rate_hz: float) -> LiveSource:
    kind, where = _taken_apart(name)
    if kind == "nl80211":
        from dap_node.scanners.nl80211 import Nl80211Radio  # noqa: PLC0415

        return PolledSource(name, partial(Nl80211Radio, where), rate_hz)
    if kind == "hostapd":
        from dap_node.scanners.hostapd import HostapdRadio  # noqa: PLC0415

        return PolledSource(name, partial(HostapdRadio, Path(where)), rate_hz)
    if kind == "ble":
        from dap_node.scanners.ble import BleSource, open_bluetooth  # noqa: PLC0415

        return BleSource(name, open_bluetooth(where), rate_hz)
    raise ScannerError(f"{name}: only one source can be given, unless all are radios")


def _taken_apart(name: str) -> tuple[str, str]:
    kind, _, where = name.partition(":")
    if not where or kind not in LIVE + PLAYED:
        raise ScannerError(f"--source {name!r}: write {FORMS}")
    return kind, where
