"""Which score a mount's recordings get."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeAlias

from edge_agent.evaluation.chest_score import score_chest
from edge_agent.evaluation.course_truth import MountTruth
from edge_agent.evaluation.score_card import TrialScore, score_trial
from edge_agent.evaluation.waist_score import score_waist
from edge_agent.mounts.interface import Increment
from shared.messages import Mount

Scorer: TypeAlias = Callable[[str, str, Sequence[Increment], MountTruth | None], TrialScore]
"""Of a trial's name and group, the increments told, in order, and the truth if there is one."""

SCORERS: dict[Mount, Scorer] = {"boot": score_trial, "chest": score_chest, "waist": score_waist}
