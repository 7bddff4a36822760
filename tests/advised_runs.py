"""``python -m tests.advised_runs``: what DAPs are worth by who says where they go, and how many.

Each rule's scenario is rehearsed with as many DAPs each as asked for.
"""

from __future__ import annotations

import re
import sys
import tempfile
from importlib.resources import files
from pathlib import Path

import msgspec
from cyclopts import App

from command_post.evaluation.pooled import PooledMethod, pool
from command_post.incident import IncidentSettings
from command_post.rehearsing.monte_carlo import Exercise, run_many
from command_post.rehearsing.rehearsal import Agents
from shared.exercise import REHEARSAL_INCIDENT

RULES = {"by hand": "", "advised": "_advised", "spaced": "_spaced"}
EACH = re.compile(r"^daps_each = \d+$", re.MULTILINE)

app = App(help="Say what DAPs are worth set down by hand, as advised, and every so many metres.")


@app.default
def tell(
    scenario: str = "offices", *, each: tuple[int, ...] = (1, 3), runs: int = 8, seed: int = 0
) -> int:
    """Rehearse, and print a JSON object a line: boxes set down a run, CE50 and CE95 in metres.

    With their 95 % intervals, by drawing the runs again.

    Example: python -m tests.advised_runs offices --each 1 --runs 2

    Parameters
    ----------
    scenario
        One that has a version for each rule: offices or four_daps.
    each
        How many DAPs everybody carries in, where the scenario says so at all; by hand it is as
        many as there are sites.
    runs
        How many of each; some minutes each.
    seed
        Of the first run.

    """
    for rule, suffix in RULES.items():
        text = (files("shared.simulation") / "scenarios" / f"{scenario}{suffix}.toml").read_text()
        counts = each if suffix and EACH.search(text) else (0,)
        for count in counts:
            told = _rehearsed(EACH.sub(f"daps_each = {count}", text) if count else text, runs, seed)
            line = {"rule": rule, "each": count or None, **told}
            sys.stdout.write(f"{msgspec.json.encode(line).decode()}\n")
            sys.stdout.flush()
    return 0


def _rehearsed(text: str, runs: int, seed: int) -> dict[str, object]:
    with tempfile.TemporaryDirectory(prefix="clew-advised-") as folder:
        path = Path(folder) / "scenario.toml"
        path.write_text(text)
        settings = IncidentSettings(incident=REHEARSAL_INCIDENT)
        exercise = Exercise(str(path), settings, Agents(None, raw=False, odometry="strides"))
        chunks = run_many(exercise, runs, seed, workers=1)
        errors = [run.errors for chunk in chunks for run in chunk]
    score = pool({"scenario": errors}).scenarios["scenario"]
    ways = {"live": score.live, "after": score.after}
    return {
        "set_down": score.daps_a_run,
        **{name: None if way is None else _figures(way) for name, way in ways.items()},
    }


def _figures(way: PooledMethod) -> dict[str, object]:
    return {"abs": way.absolute, "intervals": way.intervals.absolute}


if __name__ == "__main__":
    sys.exit(app(result_action="return_value"))
