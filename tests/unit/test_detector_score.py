"""Nearness as a detector: what counts as missed, as false and as late."""

from __future__ import annotations

import numpy as np
import pytest
from msgspec import structs

from dap_node.comparison import compare
from dap_node.detector_score import Link, evidence_of, score_detector, try_detector
from dap_node.proximity import ProximitySettings
from dap_node.range_settings import RangeSettings
from dap_node.true_range import TrueRange

PUBLISHED = ProximitySettings()


def passing_by(*, at_s: tuple[float, ...], seen: tuple[bool, ...], name: str = "walk") -> Link:
    """Return a link that is at 20 m but for 6 s about each of ``at_s``, when it is at 1 m.

    Where not ``seen``, the signal stays as weak as from afar.
    """
    time_s = np.arange(0.0, 60.0, 0.2)
    range_m, rssi_dbm = np.full(len(time_s), 20.0), np.full(len(time_s), -70.0)
    for centre_s, is_seen in zip(at_s, seen, strict=True):
        here = np.abs(time_s - centre_s) < 3.0
        range_m[here] = 1.0
        rssi_dbm[here & is_seen] = -38.0
    return Link(name, time_s, rssi_dbm, TrueRange(time_s, range_m))


def test_a_pass_unseen_is_missed_and_one_seen_is_not() -> None:
    link = passing_by(at_s=(15.0, 40.0), seen=(True, False))
    trial = try_detector(evidence_of(link, PUBLISHED), PUBLISHED, link.true_range, 2.5)
    assert (trial.passes, trial.missed) == (2, 1)
    assert trial.entered_m == pytest.approx([1.0])
    assert (trial.false_stays, trial.false_events) == (0, 0)
    assert trial.delay_s == pytest.approx([1.2], abs=0.5)
    told = score_detector([trial, trial])
    assert (told.passes, told.missed, told.stays) == (4, 2, 2)
    assert told.watched_h == pytest.approx(2 * (59.8 + 10.0) / 3600.0, abs=1e-4)


def test_a_stay_told_from_afar_is_a_false_alarm_for_every_second() -> None:
    link = passing_by(at_s=(20.0,), seen=(True,))
    afar = link._replace(true_range=TrueRange(link.time_s, np.full(300, 20.0)))
    trial = try_detector(evidence_of(afar, PUBLISHED), PUBLISHED, afar.true_range, 2.5)
    assert (trial.passes, trial.missed, trial.false_stays) == (0, 0, 1)
    assert trial.false_events == trial.events >= 5
    told = score_detector([trial])
    assert told.false_events_per_h == pytest.approx(trial.events / told.watched_h)
    assert np.isnan(told.delay_p50_s)


def test_the_likelihood_is_set_beside_the_rule_at_no_more_false_alarms() -> None:
    chance = np.random.default_rng(3)
    links = []
    for number in range(4):
        link = passing_by(at_s=(15.0, 40.0), seen=(True, True), name=f"walk {number % 2}")
        noise_db = 6.0 * chance.normal(size=len(link.time_s))
        links.append(link._replace(rssi_dbm=link.rssi_dbm + noise_db))
    # Who is gone at once is not held for a while, as walkers are.
    at_once = structs.replace(PUBLISHED, range=RangeSettings(steady_s=0.0))
    told = compare(links, at_once, 2.5)
    for row in (told.configured, *told.rows):
        for point in (row.at_rate, row.at_misses):
            if point is not None:
                allowed = row.published.score
                assert point.score.false_stays_per_h <= allowed.false_stays_per_h
                assert point.score.false_events_per_h <= allowed.false_events_per_h
        if row.at_misses is not None:
            assert row.at_misses.score.missed <= row.published.score.missed
    assert [one.recording for one in told.each] == ["walk 0", "walk 1"]
    assert [one.recording for one in told.left_out] == ["walk 0", "walk 1", "together"]
    assert told.left_out[-1].published.passes == told.configured.published.score.passes == 8
    # What nothing but noise hides, both rules find: the variance test apart.
    assert told.configured.at_rate is not None
    assert told.configured.at_rate.score.missed == 0


def test_one_recording_has_no_others_to_choose_on() -> None:
    assert compare([passing_by(at_s=(15.0,), seen=(True,))], PUBLISHED, 2.5).left_out == []
