"""What is asked of a chain between its stances, against the same said plainly."""

from __future__ import annotations

from bisect import bisect_left, bisect_right

import numpy as np
import pytest

from command_post.fusion.team.chain import PACE_S, Chain
from command_post.fusion.team.log import Start
from command_post.fusion.team.ties import _alike
from shared.units import NS_PER_S

STANCES = 60


def walked(seed: int) -> Chain:
    """Return a way with pauses, and with a unit that begins where the one before ended."""
    chance = np.random.default_rng(seed)
    rest_ns = chance.integers(0, 4 * NS_PER_S, STANCES) * (chance.random(STANCES) < 0.3)
    took_ns = chance.integers(NS_PER_S // 3, NS_PER_S, STANCES)
    took_ns[[0, 30]] = rest_ns[30] = 0
    end_ns = 1_700_000_000 * NS_PER_S + np.cumsum(rest_ns + took_ns)
    step_m = chance.normal(size=(STANCES, 2)) * (took_ns > 0)[:, None]
    return Chain(
        "r1", end_ns, end_ns - took_ns,
        np.cumsum(step_m, axis=0), np.cumsum(np.hypot(*step_m.T)), np.zeros((STANCES, 2)),
        np.zeros((STANCES, 2)), (np.arange(STANCES) >= 30).astype(np.int64), np.array([30]),
        np.empty(0, np.int64),
        [Start(int(end_ns[0]), 0, 0.1, None), Start(int(end_ns[30]), 1, 0.1, None)],
    )  # fmt: skip


def times_ns(chain: Chain, seed: int) -> np.ndarray:
    chance = np.random.default_rng(seed)
    since, until = chain.time_ns[[0, -1]] + [-2 * NS_PER_S, 2 * NS_PER_S]
    return np.sort(np.concatenate([chance.integers(since, until, 200), chain.time_ns]))


@pytest.mark.parametrize("seed", range(3))
def test_the_body_goes_on_evenly_while_a_move_lasts(seed: int) -> None:
    chain = walked(seed)
    knots_ns = np.column_stack([chain.begin_ns, chain.time_ns]).ravel()
    way_m = np.repeat(chain.way_m, 2, axis=0)
    way_m[2::2] = chain.way_m[:-1]
    asked_ns = times_ns(chain, seed)
    half_ns = round(0.5 * PACE_S * NS_PER_S)
    for axis, found in enumerate(chain.velocity_m_s(asked_ns).T):
        after = np.interp(asked_ns + half_ns, knots_ns, way_m[:, axis])
        before = np.interp(asked_ns - half_ns, knots_ns, way_m[:, axis])
        assert (found == (after - before) / PACE_S).all()
    for asked, stance, offset_m in zip(asked_ns, *chain.nearest_each(asked_ns), strict=True):
        assert (stance, *offset_m) == chain.nearest(int(asked))
        at_m = [np.interp(asked, knots_ns, along) for along in way_m.T]
        assert chain.way_m[stance] + offset_m == pytest.approx(at_m, abs=1e-5)


@pytest.mark.parametrize("seed", range(3))
def test_those_near_each_other_on_the_way_are_counted_together(seed: int) -> None:
    chance = np.random.default_rng(seed)
    way_m = np.sort(np.round(chance.uniform(0.0, 60.0, 80)))
    of_what = chance.integers(0, 4, way_m.size)
    for here_m, what, alike in zip(way_m, of_what, _alike(way_m, of_what, 5.0), strict=True):
        same_m = way_m[of_what == what].tolist()
        assert alike == bisect_right(same_m, here_m + 5.0) - bisect_left(same_m, here_m - 5.0)
