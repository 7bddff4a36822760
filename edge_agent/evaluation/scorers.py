"""Which score a mount's recordings get."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeAlias

import msgspec

from edge_agent.evaluation.chest_score import score_chest
from edge_agent.evaluation.course_truth import MountTruth, Waypoints
from edge_agent.evaluation.score_card import TrialScore, score_trial
from edge_agent.evaluation.waist_score import score_waist
from edge_agent.mounts.interface import Increment
from shared.messages import Mount

Scorer: TypeAlias = Callable[[str, str, Sequence[Increment], MountTruth | None], TrialScore]
"""Of a trial's name and group, the increments told, in order, and the truth if there is one."""


def score_boot(
    name: str, group: str, increments: Sequence[Increment], truth: MountTruth | None
) -> TrialScore:
    """Return the score of a boot at its true stances, or on its way beside another foot's.

    Where the other foot swings past cuts corners, so that it tells places but no length.
    """
    if not isinstance(truth, Waypoints):
        return score_trial(name, group, increments, truth)
    row = score_chest(name, group, increments, truth)
    return msgspec.structs.replace(row, distance_error_pct=None)


SCORERS: dict[Mount, Scorer] = {"boot": score_boot, "chest": score_chest, "waist": score_waist}
