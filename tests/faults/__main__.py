"""``python -m tests.faults``: an ordeal as long as it takes in the field."""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Literal, TypeAlias

import msgspec
from cyclopts import App

from tests.faults import mishaps, ordeals

Name: TypeAlias = Literal[
    "kills", "out_of_range", "multi_hop", "multi_hop_silent", "half_open", "half_open_slow",
    "lossy", "flapping", "flapping_slow", "narrow", "cut", "clock_steps", "full_disk", "two_posts",
    "stops",
]  # fmt: skip

LONG: dict[Name, Callable[[Path], ordeals.Outcome | mishaps.Stops]] = {
    "kills": lambda folder: ordeals.kills(folder, times=100),
    "out_of_range": lambda folder: ordeals.out_of_range(folder, away_s=600.0),
    "multi_hop": lambda folder: ordeals.multi_hop(folder, lasts_s=60.0),
    "multi_hop_silent": lambda folder: ordeals.multi_hop_silent(folder, times=10),
    "half_open": lambda folder: ordeals.half_open(folder, times=10),
    "half_open_slow": lambda folder: ordeals.half_open(folder, times=10, delay_s=0.2),
    "lossy": ordeals.lossy,
    "flapping": lambda folder: ordeals.flapping(folder, delay_s=0.05, times=20),
    "flapping_slow": lambda folder: ordeals.flapping(folder, delay_s=0.2, times=20),
    "narrow": ordeals.narrow,
    "cut": lambda folder: ordeals.narrow(folder, cut_s=600.0),
    "clock_steps": lambda folder: mishaps.clock_steps(folder, (60.0, 0.0, 10_800.0, -10_800.0)),
    "full_disk": mishaps.full_disk,
    "two_posts": mishaps.two_posts,
    "stops": lambda folder: mishaps.stops(folder, times=10),
}

app = App(help="Put an incident's programs through what happens in the field.")


@app.default
def run(ordeal: Name, *, folder: Path | None = None) -> int:
    """Run an ordeal; print as JSON what was lost, what came twice and how late live beats were.

    Of 'stops' it is how long each program took to stop.

    Example: python -m tests.faults kills

    Parameters
    ----------
    ordeal
        Which; all but 'kills', 'clock_steps' and 'two_posts' need root.
    folder
        For recording, journals and logs; a temporary one if not given.

    """
    with tempfile.TemporaryDirectory() as temporary:
        outcome = LONG[ordeal](Path(temporary) if folder is None else folder)
    sys.stdout.write(msgspec.json.encode(outcome._asdict()).decode() + "\n")
    if isinstance(outcome, mishaps.Stops):
        return 0
    return 1 if outcome.lost or outcome.repeated else 0


if __name__ == "__main__":
    sys.exit(app())
