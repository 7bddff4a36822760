"""A dump that is played as if the radio were heard now."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from dap_node.scanners.dump import EMPTY_SCAN_NS, played, read_dump
from dap_node.scanners.observation import Observation
from shared.radios.readings import RadioScan

EMPTY_SCANS = 20
"""Scanning goes on for so many empty scans, five seconds, so that every stay is seen to end."""


class RecordedScanner:
    """What the dump at ``path`` holds; raises ``ScannerError`` if it cannot be used."""

    def __init__(self, path: Path) -> None:
        self._scans = read_dump(path)

    def observations(self, start_ns: int) -> Iterator[Observation]:
        """Yield all scans, the first at ``start_ns``."""
        last_ns = start_ns
        for scan in played(self._scans, start_ns):
            last_ns = scan.time_ns
            yield scan
        for number in range(1, EMPTY_SCANS + 1):
            yield RadioScan(last_ns + number * EMPTY_SCAN_NS, ())
