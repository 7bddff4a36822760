"""What a demo runs, how fast, and where its files go."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import NamedTuple

from command_post.fusion.settings import HOLD_S
from command_post.rehearsing.rehearsal import BootMethod
from shared.files import HOLDING
from shared.recording_parts import files_of, unfinished_path
from shared.security.certificates import AUTHORITY_ID
from shared.simulation.scenario import Scenario

LONGEST_HOLD_S = 60.0
LATEST_S = 0.6
"""How late, in real time, a busy machine may make a message."""

STRIDE_TOLD_S = 8.0
"""A stride is told this long after it at the latest, by a unit that keeps up."""


class DemoSettings(NamedTuple):
    """What to run, how fast, and where its files go."""

    scenario_name: str
    scenario: Scenario
    seed: int
    speed: float
    method: BootMethod | None
    directory: Path
    shows_table: bool

    @property
    def hold_s(self) -> float:
        """Seconds of the exercise that events wait: processes are late by real time."""
        return min(self.speed * HOLD_S["team"], LONGEST_HOLD_S)

    @property
    def late_s(self) -> float:
        """Seconds of the exercise: a stride that is later is of a machine that is too slow."""
        return STRIDE_TOLD_S + self.speed * LATEST_S

    @property
    def recording(self) -> Path:
        """Where the recording is written."""
        return self.directory / f"{Path(self.scenario_name).stem}.mcap"

    @property
    def picture(self) -> Path:
        """Where the tracks are drawn."""
        return self.recording.with_suffix(".png")

    @property
    def score(self) -> Path:
        """Where the score is written."""
        return self.recording.with_suffix(".score.json")

    @property
    def logs(self) -> Path:
        """Where each process writes its log."""
        return self.directory / "logs"

    @property
    def keys(self) -> Path:
        """Where the demo's own authority is, and each node's keys."""
        return self.directory / "keys"

    @property
    def journals(self) -> Path:
        """Where each node keeps what it has said."""
        return self.directory / "journals"

    def claim(self) -> None:
        """Make the folder, and mark it as a demo's, that later ones may clear.

        Raises ``ValueError`` for one with anything of others in it: somebody's own keys may be
        there, of the same name as the demo's. Raises ``OSError`` where there can be no folder.
        """
        there = {path.name for path in self.directory.glob("*")}
        if there and HOLDING not in there:
            raise ValueError(
                f"{self.directory}: is not empty, and no demo left that; give another --output"
            )
        self.logs.mkdir(parents=True, exist_ok=True)
        (self.directory / HOLDING).touch()

    def clear(self) -> None:
        """Remove what an earlier run of the scenario left in the folder."""
        for journal in self.journals.glob("*.journal*"):
            journal.unlink()
        if (self.keys / AUTHORITY_ID).is_dir():
            shutil.rmtree(self.keys)
        unfinished = unfinished_path(self.recording)
        parts = files_of(self.recording).values()
        for path in (self.recording, unfinished, *parts, self.picture, self.score):
            path.unlink(missing_ok=True)
