"""``python -m tests.carried_daps``: how often, and how soon, a box notices that it was set down.

As in ``tests/unit/test_self_installation.py``: a minute in the hands, somebody else passes by.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence

import msgspec
import numpy as np
from cyclopts import App

from dap_node.self_installation import PutDown
from tests.carries import samples
from tests.unit.test_self_installation import (
    CARRIER,
    LYING,
    PASSER_BY,
    SET_DOWN_S,
    Noticed,
    offs_s,
    run,
)

app = App(help="Say how often and how soon a box notices by itself that it was set down.")


@app.default
def tell(*, carries: int = 200, felt: int = 50) -> int:
    """Carry boxes, and print one JSON object.

    Example: python -m tests.carried_daps --carries 20 --felt 5

    Parameters
    ----------
    carries
        How many without an accelerometer, and how many times somebody only passes by.
    felt
        How many with one.

    """
    walks = {"r1": CARRIER, "r2": PASSER_BY}
    told = {
        "without_accelerometer": _summed_up([run(walks, seed) for seed in range(carries)]),
        "with_accelerometer": _summed_up(
            [run(walks, seed, samples(LYING, seed)) for seed in range(felt)]
        ),
        "passes": carries,
        "passes_taken_for_a_carry": sum(
            bool(run({"r2": PASSER_BY}, seed)) for seed in range(carries)
        ),
    }
    sys.stdout.write(f"{msgspec.json.encode(told).decode()}\n")
    return 0


def _summed_up(found: Sequence[Sequence[Noticed]]) -> dict[str, float]:
    """Return how many were noticed, of whom rightly, and how far off the time is (s)."""
    down = [one[0] for one in found if one and isinstance(one[0], PutDown)]
    off_s = np.abs(offs_s(found, SET_DOWN_S))
    return {
        "carries": len(found),
        "noticed": len(down),
        "by_who_carried_it": sum(each.installer_id == "r1" for each in down),
        "off_p95_s": round(float(np.quantile(off_s, 0.95)), 2),
        "off_most_s": round(float(off_s.max()), 2),
    }


if __name__ == "__main__":
    sys.exit(app(result_action="return_value"))
