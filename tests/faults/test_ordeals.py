"""The ordeals, as long as they must be to show something: nothing is lost, nothing comes twice."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from tests.faults import ordeals
from tests.faults.air import Link, why_no_air
from tests.faults.ordeals import Outcome

NO_AIR = why_no_air()
in_air = pytest.mark.skipif(NO_AIR is not None, reason=str(NO_AIR))


@pytest.mark.parametrize(
    "ordeal",
    [
        pytest.param(
            lambda folder: ordeals.kills(folder, times=4, lives_s=1.0, daps=["dap1"]), id="kills"
        ),
        pytest.param(
            lambda folder: ordeals.bad_air(
                folder, 2, Link(delay_s=0.01, loss=0.2), cut_s=3.0, after_s=4.0, more=2
            ),
            id="lossy",
            marks=in_air,
        ),
    ],
)
def test_nothing_is_lost(ordeal: Callable[[Path], Outcome], tmp_path: Path) -> None:
    outcome = ordeal(tmp_path)
    assert outcome.journalled > 5
    assert (outcome.lost, outcome.repeated) == (0, 0)
