"""Who is near: what begins a stay, what keeps it, and what ends it."""

from __future__ import annotations

import pytest

from dap_node.proximity import Proximity, ProximityDetector, ProximitySettings
from shared.config import ConfigError, parse_toml
from shared.rssi_window import sum_up
from shared.units import NS_PER_S

PERIOD_S = 0.2
NEAR_DBM, FAR_DBM, BETWEEN_DBM = -40.0, -70.0, -50.0
"""Above both thresholds, below both, and between the two."""

SETTINGS = ProximitySettings()


def ns(time_s: float) -> int:
    return round(time_s * NS_PER_S)


class Scanned:
    """A detector fed at the pace of scans, each followed by a tick."""

    def __init__(self, settings: ProximitySettings = SETTINGS) -> None:
        self.detector = ProximityDetector(settings)
        self.told: list[Proximity] = []
        self._scans = 0

    def now_s(self) -> float:
        """Time of the last scan."""
        return self._scans * PERIOD_S

    def hear(self, duration_s: float, *values_dbm: float) -> list[str]:
        """Scan for ``duration_s``, hearing the values in turn; return the phases told."""
        before = len(self.told)
        for index in range(round(duration_s / PERIOD_S)):
            self._scans += 1
            if values_dbm:
                value_dbm = values_dbm[index % len(values_dbm)]
                self.detector.add(ns(self.now_s()), "r1", value_dbm)
            self.told += self.detector.tick(ns(self.now_s()))
        return [event.phase for event in self.told[before:]]


def test_who_comes_near_enters_stays_and_leaves() -> None:
    scanned = Scanned()
    assert scanned.hear(3.0, FAR_DBM) == []
    assert scanned.hear(4.0, NEAR_DBM) == ["entered", "near", "near"]
    assert scanned.hear(3.0, FAR_DBM) == ["left"]
    assert scanned.hear(3.0, FAR_DBM) == []


def test_an_event_tells_the_window_and_its_middle() -> None:
    scanned = Scanned()
    scanned.hear(0.6, -40.0, -42.0, -44.0)
    assert scanned.told == []
    scanned.hear(0.2, -46.0)
    (event,) = scanned.told
    assert (event.phase, event.responder_id) == ("entered", "r1")
    assert event.heard == (ns(0.5), -43.0, 5.0, 4)
    assert event.time_ns == ns(0.5)


def test_strong_signal_that_varies_is_not_near() -> None:
    scanned = Scanned()
    assert scanned.hear(3.0, -38.0, -50.0) == []
    assert scanned.hear(2.0, -44.0)[0] == "entered"


def test_a_stay_ends_when_the_signal_varies() -> None:
    scanned = Scanned()
    scanned.hear(3.0, NEAR_DBM)
    assert scanned.hear(2.0, -34.0, -48.0)[-1] == "left"


@pytest.mark.parametrize("before_dbm", [NEAR_DBM, FAR_DBM])
def test_between_the_thresholds_all_stays_as_it_was(before_dbm: float) -> None:
    scanned = Scanned()
    scanned.hear(3.0, before_dbm)
    phases = set(scanned.hear(6.0, BETWEEN_DBM))
    assert phases == ({"near"} if before_dbm == NEAR_DBM else set())


def test_a_stay_has_a_least_length() -> None:
    scanned = Scanned(ProximitySettings(dwell_s=5.0, repeat_s=60.0))
    assert scanned.hear(0.8, NEAR_DBM) == ["entered"]
    assert scanned.hear(4.8, FAR_DBM) == []
    assert scanned.hear(0.2, FAR_DBM) == ["left"]


def test_nearness_is_told_again_every_period() -> None:
    scanned = Scanned(ProximitySettings(repeat_s=0.5))
    phases = scanned.hear(20.8, NEAR_DBM)
    assert phases == ["entered"] + 40 * ["near"]


def test_a_few_samples_are_not_enough() -> None:
    scanned = Scanned(ProximitySettings(least_samples=5))
    assert scanned.hear(0.8, NEAR_DBM) == []
    assert scanned.hear(5.0) == []
    assert scanned.hear(1.0, NEAR_DBM) == ["entered"]


def test_who_falls_silent_has_left_after_a_while() -> None:
    scanned = Scanned()
    scanned.hear(3.0, NEAR_DBM)
    last = scanned.told[-1]
    silent_s = scanned.now_s()
    assert scanned.hear(SETTINGS.silence_s - PERIOD_S) == ["near"]
    assert scanned.hear(PERIOD_S) == ["left"]
    left = scanned.told[-1]
    assert left.time_ns == ns(silent_s + SETTINGS.silence_s)
    assert left.heard.mean_dbm == last.heard.mean_dbm
    assert left.heard.sample_count >= SETTINGS.least_samples
    assert scanned.hear(10.0) == []


def test_a_short_gap_ends_nothing() -> None:
    scanned = Scanned()
    scanned.hear(3.0, NEAR_DBM)
    scanned.hear(2.0)
    assert "left" not in scanned.hear(3.0, NEAR_DBM)
    assert "entered" not in scanned.hear(3.0, NEAR_DBM)


def test_late_samples_find_their_place_and_too_late_ones_none() -> None:
    detector = ProximityDetector(ProximitySettings(window_s=1.0))
    for time_s, value_dbm in ((1.9, -40.0), (1.3, -42.0), (1.6, -44.0), (0.9, 0.0), (1.2, -46.0)):
        detector.add(ns(time_s), "r1", value_dbm)
    (event,) = detector.tick(ns(2.0))
    assert event.heard == (ns(1.5), -43.0, 5.0, 4)


def test_samples_of_the_future_wait() -> None:
    detector = ProximityDetector(SETTINGS)
    for time_s in (1.0, 1.2, 1.4, 1.6):
        detector.add(ns(time_s), "r1", NEAR_DBM)
    assert detector.tick(ns(1.5)) == []
    assert [event.phase for event in detector.tick(ns(1.6))] == ["entered"]


def test_of_two_samples_at_one_time_the_stronger_counts() -> None:
    told = []
    for values_dbm in ((-40.0, -60.0), (-60.0, -40.0)):
        detector = ProximityDetector(SETTINGS)
        for time_s in (0.2, 0.4, 0.6, 0.8):
            for value_dbm in values_dbm:
                detector.add(ns(time_s), "r1", value_dbm)
        told.append(detector.tick(ns(0.8)))
    assert told[0] == told[1]
    assert told[0][0].heard[1:] == (-40.0, 0.0, 4)


def test_a_late_sample_does_not_turn_time_back() -> None:
    scanned = Scanned(ProximitySettings(repeat_s=0.2))
    scanned.hear(1.4, NEAR_DBM)
    for late in range(60):
        scanned.detector.add(ns(0.21 + 0.001 * late), "r1", NEAR_DBM)
    scanned.hear(3.0, NEAR_DBM)
    times = [event.time_ns for event in scanned.told]
    assert times == sorted(times)


def test_responders_do_not_mix() -> None:
    detector = ProximityDetector(SETTINGS)
    for index in range(1, 9):
        detector.add(ns(0.2 * index), "r2", NEAR_DBM)
        detector.add(ns(0.2 * index), "r1", FAR_DBM if index % 2 else NEAR_DBM)
    assert [(event.responder_id, event.phase) for event in detector.tick(ns(1.6))] == [
        ("r2", "entered")
    ]


def test_sums_are_exact_where_the_mean_is() -> None:
    assert sum_up({10: -50.0, 20: -60.0}) == (15, -55.0, 25.0, 2)


@pytest.mark.parametrize(
    ("toml", "complaint"),
    [
        ("leave_dbm = -40.0", "at or below enter_dbm"),
        ("leave_variance_db2 = 1.0", "at or above enter_variance_db2"),
        ("silence_s = 0.5", "at or above window_s"),
        ("window = 3.0", "did you mean 'window_s'"),
        ("least_samples = 1", "least_samples"),
    ],
)
def test_thresholds_that_cannot_work_are_refused(toml: str, complaint: str) -> None:
    with pytest.raises(ConfigError, match=complaint):
        parse_toml(toml, ProximitySettings, "proximity.toml")
