"""Sources that are played, by their name on the command line: ``KIND:WHERE``.

A kind's module is imported when one is opened: a DAP that listens to a radio has no use for what
simulating takes, nor room for it.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Protocol, runtime_checkable

from dap_node.scanners.observation import Observation
from shared.messages import NodeId

PLAYED = ("recorded:FILE", "simulated:SCENARIO")


@runtime_checkable
class Playable(Protocol):
    """Observations that are known beforehand."""

    def observations(self, start_ns: int) -> Iterator[Observation]:
        """Yield them in the order of time, counted from ``start_ns``."""


def open_played(name: str, dap_id: NodeId, seed: int) -> Playable | None:
    """Open ``recorded:FILE`` or ``simulated:SCENARIO``; ``None`` for another kind.

    Raises ``ScannerError`` for a file that cannot be used, ``ValueError`` for a scenario.
    """
    kind, _, where = name.partition(":")
    if not where:
        return None
    if kind == "recorded":
        from dap_node.scanners.recorded import RecordedScanner  # noqa: PLC0415

        return RecordedScanner(Path(where))
    if kind == "simulated":
        from dap_node.scanners.simulated import SimulatedScanner  # noqa: PLC0415
        from shared.simulation.scenario import load_scenario  # noqa: PLC0415

        return SimulatedScanner(load_scenario(where), dap_id, seed)
    return None
