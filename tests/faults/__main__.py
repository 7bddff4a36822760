"""``python -m tests.faults``: an ordeal as long as it takes in the field."""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Literal, TypeAlias

import msgspec
from cyclopts import App

from tests.faults import ordeals

Name: TypeAlias = Literal[
    "kills", "out_of_range", "multi_hop", "multi_hop_silent", "half_open", "half_open_slow",
    "lossy", "narrow", "cut",
]  # fmt: skip

LONG: dict[Name, Callable[[Path], ordeals.Outcome]] = {
    "kills": lambda folder: ordeals.kills(folder, times=100),
    "out_of_range": lambda folder: ordeals.out_of_range(folder, away_s=600.0),
    "multi_hop": lambda folder: ordeals.multi_hop(folder, lasts_s=60.0),
    "multi_hop_silent": lambda folder: ordeals.multi_hop_silent(folder, times=10),
    "half_open": lambda folder: ordeals.half_open(folder, times=10),
    "half_open_slow": lambda folder: ordeals.half_open(folder, times=10, delay_s=0.2),
    "lossy": ordeals.lossy,
    "narrow": ordeals.narrow,
    "cut": lambda folder: ordeals.narrow(folder, cut_s=600.0),
}

app = App(help="Put an incident's programs through what happens in the field.")


@app.default
def run(ordeal: Name, *, folder: Path | None = None) -> int:
    """Run an ordeal; print as JSON what was lost, what came twice and how late live beats were.

    Example: python -m tests.faults kills

    Parameters
    ----------
    ordeal
        Which; all but 'kills' need root, for the air between the nodes.
    folder
        For recording, journals and logs; a temporary one if not given.

    """
    with tempfile.TemporaryDirectory() as temporary:
        outcome = LONG[ordeal](Path(temporary) if folder is None else folder)
    sys.stdout.write(msgspec.json.encode(outcome._asdict()).decode() + "\n")
    return 1 if outcome.lost or outcome.repeated else 0


if __name__ == "__main__":
    sys.exit(app())
