"""The published course of 83.5 m, walked by three simulated people, as the paper measured it."""

from __future__ import annotations

import json

import pytest

from edge_agent.__main__ import app

PAPER_WORST_PCT = 0.61
"""The worst of the paper's three testers."""


def taped_errors_pct(capfdbinary: pytest.CaptureFixture[bytes], seed: int) -> list[float]:
    app(
        ["evaluate", "--method", "linear", "simulated:course", "--seed", str(seed), "--json"],
        result_action="return_value",
    )
    card = json.loads(capfdbinary.readouterr().out)
    assert [trial["failure"] for trial in card["trials"]] == [None] * 3
    return [abs(trial["taped_error_pct"]) for trial in card["trials"]]


def test_three_people_come_out_as_in_the_paper(
    capfdbinary: pytest.CaptureFixture[bytes],
) -> None:
    assert max(taped_errors_pct(capfdbinary, seed=0)) <= PAPER_WORST_PCT


def test_so_do_others_more_often_than_not(capfdbinary: pytest.CaptureFixture[bytes]) -> None:
    errors_pct = [error for seed in (1, 2, 3) for error in taped_errors_pct(capfdbinary, seed)]
    within = [error for error in errors_pct if error <= PAPER_WORST_PCT]
    assert len(within) > len(errors_pct) / 2
    assert max(errors_pct) < 1.5
