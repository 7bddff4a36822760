"""Three responders, four DAPs: what the filter is for, on a world whose errors are known."""

from __future__ import annotations

import numpy as np
import pytest

from command_post.desks.announcer import Outgoing
from command_post.evaluation.errors import RunErrors, measure
from command_post.evaluation.evidence import Evidence
from command_post.evaluation.pooled import pool
from command_post.evaluation.score_card import Score, score
from command_post.fusion.settings import FusionSettings
from command_post.fusion.time_line import TimeLineSettings
from command_post.incident import Incident, IncidentSettings
from shared.codec import Refusal, decode, parse_key
from tests.stride_world import Heard, exercise

HOLD_S = 1.5
"""Longer than anything is on its way."""


def fuse(heard: list[Heard]) -> list[Outgoing]:
    incident = Incident(IncidentSettings(time_line=TimeLineSettings(hold_s=HOLD_S)))
    made = [o for h in heard for o in incident.handle(h.key, h.payload, h.now_ns)]
    made += incident.finish(heard[-1].now_ns)
    assert not incident.refusals
    assert not incident.counts.total()
    return made


def evidence_of(heard: list[Heard], made: list[Outgoing]) -> Evidence:
    evidence = Evidence()
    for key_text, payload in [(h.key, h.payload) for h in heard] + [*made]:
        key = parse_key(key_text)
        assert not isinstance(key, Refusal)
        message = decode(key, payload)
        assert not isinstance(message, Refusal), message
        evidence.add(key, message)
    return evidence


@pytest.fixture(scope="module")
def errors() -> list[RunErrors]:
    return [measure(evidence_of(heard, fuse(heard))) for heard in map(exercise, range(6))]


def test_daps_take_the_offset_and_the_drift_away(errors: list[RunErrors]) -> None:
    world = pool({"world": errors}).scenarios["world"]
    for live, pdr in (
        (world.live.absolute, world.pdr.absolute),
        (world.live.team, world.pdr.team),
        (world.live.pair, world.pdr.pair),
    ):
        assert live is not None
        assert pdr is not None
        assert live.ce50_m < 0.5 * pdr.ce50_m
        assert live.ce95_m < 0.3 * pdr.ce95_m
    assert world.live.fail_pct == 0.0
    assert world.pdr.fail_pct is not None
    assert world.pdr.fail_pct > 30.0


def test_the_map_is_as_good_as_its_makers(errors: list[RunErrors]) -> None:
    assert {frozenset(run.live.dap_m) for run in errors} == {frozenset({"dap2", "dap3", "dap4"})}
    assert np.median([error for run in errors for error in run.live.dap_m.values()]) < 2.0


def test_every_responder_is_scored(errors: list[RunErrors]) -> None:
    card: Score = score(errors[0])
    assert set(card.responders) == {"r1", "r2", "r3"}
    assert card.coverage95_pct is not None
    assert card.coverage95_pct > 50.0
    worst = card.responders["r3"]
    assert worst.live_end_m is not None
    assert worst.pdr_end_m is not None
    assert worst.live_end_m < 0.5 * worst.pdr_end_m


def test_the_same_is_made_again_to_the_bit() -> None:
    heard = exercise(3)
    assert fuse(heard) == fuse(heard)


def test_order_of_arrival_within_the_hold_changes_no_bit() -> None:
    heard = exercise(3)
    numbers = np.random.Generator(np.random.Philox(99))
    delay_ns = numbers.integers(0, 1_200_000_000, len(heard))
    shuffled = sorted(
        Heard(each.now_ns + int(late_ns), each.key, each.payload)
        for each, late_ns in zip(heard, delay_ns, strict=True)
    )
    assert [each.payload for each in shuffled] != [each.payload for each in heard]
    assert fuse(shuffled) == fuse(heard)


def test_another_seed_of_the_published_filter_makes_another_estimate() -> None:
    made = []
    for seed in (7, 8):
        fusion = FusionSettings(method="published", seed=seed)
        incident = Incident(IncidentSettings(fusion=fusion))
        made.append([o for h in exercise(3) for o in incident.handle(h.key, h.payload, h.now_ns)])
    assert made[0][20:40] != made[1][20:40]
