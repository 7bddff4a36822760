"""The filter over range and offset: what it holds after strong, weak, few and no readings."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm

from dap_node.range_filter import POWER_AT_1_M_DBM, RangeFilter
from dap_node.range_settings import Belief, RangeSettings
from shared.config import ConfigError, parse_toml
from shared.units import NS_PER_S

SETTINGS = RangeSettings()
PERIOD_NS = NS_PER_S // 5


def heard(*levels_dbm: float, each: int = 25, settings: RangeSettings = SETTINGS) -> RangeFilter:
    """Return a filter that heard ``each`` readings of every level in turn, five a second."""
    one = RangeFilter(settings)
    for number, level_dbm in enumerate(np.repeat(levels_dbm, each).tolist(), start=1):
        one.hear(number * PERIOD_NS, level_dbm)
    return one


def after(one: RangeFilter, readings: int, wait_s: float = 0.0) -> Belief:
    return one.believe(readings * PERIOD_NS + round(wait_s * NS_PER_S))


def level_dbm(range_m: float) -> float:
    return POWER_AT_1_M_DBM - 10.0 * SETTINGS.exponent * float(np.log10(range_m))


def test_before_anything_is_heard_the_floor_is_as_likely_everywhere() -> None:
    belief = RangeFilter(SETTINGS).believe(0)
    near = 1.0 / (1.0 + np.exp(-belief.log_odds))
    assert near == pytest.approx((SETTINGS.near_m / 18.2) ** 2, rel=0.01)
    assert belief.offset_db == pytest.approx(0.0, abs=1e-9)


def test_strong_is_near_and_weak_is_not() -> None:
    near, between, far = (after(heard(level_dbm(m)), 25) for m in (0.8, 5.0, 12.0))
    assert near.log_odds > SETTINGS.enter_log_odds + 1.0
    assert near.log_odds > between.log_odds > far.log_odds
    assert far.log_odds < SETTINGS.leave_log_odds - 1.0
    assert near.range_m < between.range_m < far.range_m


def test_a_short_fade_does_not_undo_what_was_heard() -> None:
    one = heard(level_dbm(0.8))
    before = after(one, 25).log_odds
    one.hear(26 * PERIOD_NS, -80.0)
    assert after(one, 26).log_odds > before - 1.5


def test_readings_in_quick_succession_weigh_no_more_than_one_a_second() -> None:
    often, seldom = RangeFilter(SETTINGS), RangeFilter(SETTINGS)
    for number in range(1, 101):
        often.hear(number * NS_PER_S // 20, level_dbm(1.5))
    for number in range(1, 6):
        seldom.hear(number * NS_PER_S, level_dbm(1.5))
    once, five_s = often.believe(5 * NS_PER_S), seldom.believe(5 * NS_PER_S)
    assert once.log_odds == pytest.approx(five_s.log_odds, abs=0.5)


def test_a_repeated_or_late_reading_says_nothing() -> None:
    one, other = heard(level_dbm(1.0)), heard(level_dbm(1.0))
    other.hear(25 * PERIOD_NS, -90.0)
    other.hear(20 * PERIOD_NS, -90.0)
    assert after(one, 25) == after(other, 25)


@pytest.mark.parametrize("wait_s", [600.0, 5000.0])
def test_of_who_is_silent_only_the_offset_is_remembered(wait_s: float) -> None:
    one = heard(level_dbm(0.5) + 6.0, each=200)
    then, later = after(one, 200), after(one, 200, wait_s)
    assert later.log_odds == pytest.approx(RangeFilter(SETTINGS).believe(0).log_odds, abs=0.1)
    assert later.offset_db == pytest.approx(then.offset_db)
    assert later.offset_db > 1.0


def test_a_link_that_is_weaker_throughout_is_found_out() -> None:
    """Passing by and going away again tells the offset, by how strong it ever gets."""
    ranges_m = np.tile(np.abs(np.linspace(-9.0, 9.0, 90)) + 1.0, 4)
    walk_dbm = [level_dbm(range_m) for range_m in ranges_m.tolist()]
    found = []
    for offset_db in (-5.0, 0.0, 5.0):
        one = heard(*(value + offset_db for value in walk_dbm), each=1)
        found.append(after(one, len(walk_dbm)).offset_db)
    assert found == sorted(found)
    assert found[2] - found[0] > 4.0


def exact(rssi_dbm: list[float], period_s: float) -> tuple[float, float]:
    """Return log odds and mean range after readings, with motion as it is exactly."""
    near_m, edges = SETTINGS.near_m, [SETTINGS.near_m * ring / 3 for ring in range(4)]
    while edges[-1] < SETTINGS.farthest_m:
        edges.append(edges[-1] + 1.25 * (edges[-1] - edges[-2]))
    edge_m = np.array(edges)
    area_m2 = np.pi * np.diff(edge_m**2)
    range_m = np.sqrt((edge_m[1:] ** 2 + edge_m[:-1] ** 2) / 2.0)
    crossing = SETTINGS.diffusion_m2_s * 2.0 * np.pi * edge_m[1:-1] / np.diff(range_m)
    rate = np.diag(crossing / area_m2[:-1], -1) + np.diag(crossing / area_m2[1:], 1)
    rate -= np.diag(rate.sum(axis=0))
    steps = np.linspace(-2.0, 2.0, 9)
    belief = np.outer(area_m2 / area_m2.sum(), np.exp(-0.5 * steps**2))
    loss_db = 10.0 * SETTINGS.exponent * np.log10(np.hypot(range_m, SETTINGS.height_m))
    mean_dbm = POWER_AT_1_M_DBM - loss_db[:, None] + SETTINGS.offset_sd_db * steps
    mean_dbm[edge_m[:-1] >= SETTINGS.far_m] = SETTINGS.far_dbm
    is_far = (edge_m[:-1] >= SETTINGS.far_m)[:, None]
    spread_db = np.where(is_far, SETTINGS.far_spread_db, SETTINGS.spread_db)
    share = np.where(is_far, 0.0, SETTINGS.body_share)

    def density(over_db: np.ndarray) -> np.ndarray:
        return np.asarray(np.exp(-0.5 * (over_db / spread_db) ** 2) / spread_db)

    step = expm(rate * period_s)
    motion, weight = np.eye(len(rate)), 1.0
    for reading_dbm in rssi_dbm:
        over_db = reading_dbm - mean_dbm
        said = (1.0 - share) * density(over_db) + share * density(over_db + SETTINGS.body_loss_db)
        belief = (motion @ belief) * (said + 1e-8) ** weight
        belief /= belief.sum()
        motion, weight = step, min(1.0, period_s / SETTINGS.coherence_s)
    rings = belief.sum(axis=1)
    near = rings[edge_m[1:] <= near_m + 1e-9].sum()
    return float(np.log(near / (1.0 - near))), float(rings @ range_m)


@pytest.mark.parametrize("period_s", [0.2, 0.5, 3.0])
def test_it_holds_what_exact_motion_would(period_s: float) -> None:
    chance = np.random.default_rng(4)
    range_m = np.concatenate([np.linspace(9.0, 0.5, 30), np.linspace(0.5, 12.0, 30)])
    rssi_dbm = [level_dbm(each) + chance.normal(0.0, 5.0) for each in range_m.tolist()]
    one = RangeFilter(SETTINGS)
    for number, dbm in enumerate(rssi_dbm, start=1):
        one.hear(round(number * period_s * NS_PER_S), dbm)
        held = one.believe(round(number * period_s * NS_PER_S))
        if number % 10 == 0:
            meant = exact(rssi_dbm[:number], period_s)
            assert (held.log_odds, held.range_m) == pytest.approx(meant, abs=0.25)


@pytest.mark.parametrize(
    ("toml", "complaint"),
    [
        ("leave_log_odds = 1.0", "at or below enter_log_odds"),
        ("near_m = 7.0", "far_m: put it between"),
        ("farthest_m = 5.0", "far_m: put it between"),
        ("spread = 3.0", "did you mean 'spread_db'"),
    ],
)
def test_what_cannot_work_is_refused(toml: str, complaint: str) -> None:
    with pytest.raises(ConfigError, match=complaint):
        parse_toml(toml, RangeSettings, "dap.toml")
