"""The published exercise, rehearsed: what the fusion is for."""

from __future__ import annotations

from command_post.evaluation.pooled import pool
from command_post.fusion.settings import FusionSettings
from command_post.incident import IncidentSettings
from command_post.rehearsing.monte_carlo import Exercise, run_chunk
from command_post.rehearsing.rehearsal import Agents
from shared.exercise import REHEARSAL_INCIDENT

SETTINGS = IncidentSettings(incident=REHEARSAL_INCIDENT, fusion=FusionSettings())
EXERCISE = Exercise("four_daps", SETTINGS, Agents("linear", raw=False))


def test_fusion_brings_the_team_together() -> None:
    # One after the other, that their programs start once.
    runs = run_chunk(EXERCISE, range(2))
    told = pool({"four_daps": [run.errors for run in runs]}).scenarios["four_daps"]
    assert told.live.pair is not None
    assert told.pdr.pair is not None
    assert told.live.pair.ce95_m <= 0.6 * told.pdr.pair.ce95_m
    assert told.live.team is not None
    assert told.pdr.team is not None
    assert told.live.team.ce95_m < told.pdr.team.ce95_m
