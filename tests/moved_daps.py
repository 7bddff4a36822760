"""``python -m tests.moved_daps``: how soon a DAP that was put elsewhere is named.

Each of many patrols is walked twice: with nothing wrong, and with one DAP elsewhere since a moment.
"""

from __future__ import annotations

import math
import sys
from typing import NamedTuple

import msgspec
import numpy as np
from cyclopts import App

from command_post.fusion.team.settings import TeamSettings
from shared.messages import RssiPeak
from shared.units import NS_PER_S
from tests.patrol_world import DAPS_M, Faults, Patrol, patrol
from tests.stride_world import START_NS
from tests.unit.test_doubts import fused

SPOTS_M = [
    (0.4, 10.0), (0.0, 15.0), (3.0, 30.0), (16.0, 30.0), (19.6, 25.0), (20.0, 12.0), (12.0, 15.0),
    (20.0, 3.0), (5.0, 15.3), (0.3, 27.0),
]  # fmt: skip
APART_M = 6.0
SECOND, SOON_S = 2, 60.0


class Named(NamedTuple):
    """What came of one patrol. ``after_s`` is from the second pass that can tell to the naming.

    ``falsely`` is what was doubted with nothing wrong, ``off_m`` how far from its spot the DAP is
    held to stand at the end.
    """

    falsely: tuple[str, ...]
    after_s: float | None
    off_m: float


def moved(seed: int) -> Named:
    """Walk the patrol of ``seed`` twice, and say what was named."""
    chance = np.random.default_rng([seed, 77])
    clean = fused(seed, None, lasts_s=math.inf)
    dap_id = f"dap{chance.integers(2, 7)}"
    spots = [spot for spot in SPOTS_M if math.dist(spot, DAPS_M[dap_id]) > APART_M]
    spot = spots[chance.integers(len(spots))]
    faults = Faults(since_s=float(chance.uniform(120.0, 180.0)), moved=(dap_id, spot))
    told = fused(seed, faults, lasts_s=math.inf)
    passes_s = _passes_s(patrol(seed, faults), dap_id, faults.since_s)
    named_s = told.named_s.get(("moved", dap_id))
    late = named_s is None or len(passes_s) < SECOND
    place = told.tracker.daps[dap_id].position
    return Named(
        tuple(f"{kind} {node_id}" for kind, node_id in clean.named_s),
        None if named_s is None or late else named_s - passes_s[SECOND - 1],
        math.dist((place.north_m, place.east_m), spot),
    )


def _passes_s(world: Patrol, dap_id: str, since_s: float) -> list[float]:
    """Return when somebody passed a DAP loudly enough to tell where it stands."""
    least_dbm = TeamSettings().sharpness.least_dbm
    times_s = (
        (message.event_time_ns - START_NS) / NS_PER_S
        for node_id, message in world.heard
        if node_id == dap_id and isinstance(message, RssiPeak) and message.peak_dbm >= least_dbm
    )
    return sorted(each for each in times_s if each >= since_s)


app = App(help="Say how soon a DAP that was put elsewhere is named.")


@app.default
def run(*, runs: int = 200, first: int = 0) -> int:
    """Walk patrols, and print one JSON object: named, soon, falsely, and how well found again.

    Example: python -m tests.moved_daps --runs 20

    Parameters
    ----------
    runs
        How many; some five seconds each.
    first
        The first seed.

    """
    found = []
    for seed in range(first, first + runs):
        found.append(moved(seed))
        sys.stderr.write(f"\r{len(found)} of {runs}")
    after_s = [each.after_s for each in found if each.after_s is not None]
    off_m = [each.off_m for each in found]
    told = {
        "runs": runs,
        "named": len(after_s),
        "within_60_s": sum(each <= SOON_S for each in after_s),
        "after_second_pass_s": dict(zip(("p50", "p95", "most"), _spread(after_s), strict=True)),
        "off_m": dict(zip(("p50", "p95", "most"), _spread(off_m), strict=True)),
        "doubted_with_nothing_wrong": sum(bool(each.falsely) for each in found),
    }
    sys.stdout.write(f"\n{msgspec.json.encode(told).decode()}\n")
    return 0


def _spread(values: list[float]) -> tuple[float, float, float]:
    p50, p95, most = np.quantile(values or [math.nan], [0.5, 0.95, 1.0]).tolist()
    return p50, p95, most


if __name__ == "__main__":
    sys.exit(app(result_action="return_value"))
