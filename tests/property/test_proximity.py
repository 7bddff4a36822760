"""What holds of nearness whatever is heard."""

from __future__ import annotations

from random import Random
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dap_node.proximity import Proximity, ProximityDetector, ProximitySettings
from shared.rssi_window import sum_up

PERIOD_NS = 200_000_000
TICKS = 60


class Sample(NamedTuple):
    """A sample as it arrives: in which tick, of what time, and what it says."""

    tick: int
    time_ns: int
    responder_id: str
    rssi_dbm: float


@st.composite
def samples(draw: st.DrawFn) -> Sample:
    """Return a sample that arrives in its time, too late or too early."""
    tick = draw(st.integers(1, TICKS))
    behind = draw(st.sampled_from([0, 0, 0, 0, 1, 3, 20, -2]))
    return Sample(
        tick,
        max(1, (tick - behind) * PERIOD_NS + draw(st.integers(-3, 3))),
        draw(st.sampled_from(["r1", "r2"])),
        draw(st.sampled_from([-38.0, -44.0, -48.0, -50.0, -53.0, -70.0])),
    )


@st.composite
def visits(draw: st.DrawFn) -> list[Sample]:
    """Return samples of somebody who comes and goes, and others among them."""
    levels = draw(st.lists(st.sampled_from([-42.0, -50.0, -60.0, None]), min_size=4, max_size=8))
    each = TICKS // len(levels)
    visit = [
        Sample(tick, tick * PERIOD_NS, "r1", level)
        for index, level in enumerate(levels)
        for tick in range(index * each + 1, (index + 1) * each + 1)
        if level is not None
    ]
    return visit + draw(st.lists(samples(), max_size=30))


settings = st.builds(
    ProximitySettings,
    method=st.sampled_from(["published", "published", "likelihood"]),
    window_s=st.sampled_from([0.6, 1.5, 3.0]),
    least_samples=st.sampled_from([2, 4]),
    dwell_s=st.sampled_from([0.1, 1.0, 4.0]),
    repeat_s=st.sampled_from([0.2, 1.0]),
)


def run(given_samples: list[Sample], chosen: ProximitySettings) -> list[Proximity]:
    """Return what is told: in each tick, samples are added in the order of the list."""
    detector = ProximityDetector(chosen)
    told = []
    for tick in range(1, TICKS + 30):
        for sample in given_samples:
            if sample.tick == tick:
                detector.add(sample.time_ns, sample.responder_id, sample.rssi_dbm)
        told += detector.tick(tick * PERIOD_NS)
    return told


@given(visits(), settings)
def test_stays_begin_go_on_and_end_in_this_order(
    heard: list[Sample], chosen: ProximitySettings
) -> None:
    for responder_id in ("r1", "r2"):
        stays = [event for event in run(heard, chosen) if event.responder_id == responder_id]
        inside = False
        for event in stays:
            assert inside == (event.phase != "entered")
            inside = event.phase != "left"
        assert not inside, "all have fallen silent"


@given(visits(), settings)
def test_times_do_not_go_back_within_a_stay_nor_ahead(
    heard: list[Sample], chosen: ProximitySettings
) -> None:
    detector = ProximityDetector(chosen)
    since_ns = {"r1": 0, "r2": 0}
    for tick in range(1, TICKS + 30):
        for sample in heard:
            if sample.tick == tick:
                detector.add(sample.time_ns, sample.responder_id, sample.rssi_dbm)
        for event in detector.tick(tick * PERIOD_NS):
            if event.phase != "entered":
                assert event.time_ns >= since_ns[event.responder_id]
            assert event.time_ns <= tick * PERIOD_NS
            if chosen.method == "published":
                assert event.heard.sample_count >= chosen.least_samples
            since_ns[event.responder_id] = event.time_ns


@given(visits(), settings, st.randoms(use_true_random=False))
def test_order_and_repetition_within_a_tick_change_nothing(
    heard: list[Sample], chosen: ProximitySettings, chance: Random
) -> None:
    shuffled = heard + heard[::2]
    chance.shuffle(shuffled)
    assert run(shuffled, chosen) == run(heard, chosen)


@given(
    st.dictionaries(
        st.integers(0, 2**62), st.floats(-120.0, 0.0).map(lambda x: round(x, 3)), min_size=1
    )
)
def test_mean_and_variance_are_those_of_numpy(rssi_dbm: dict[int, float]) -> None:
    told = sum_up(rssi_dbm)
    values = np.array(list(rssi_dbm.values()))
    assert told.mean_dbm == pytest.approx(values.mean(), abs=1e-9)
    assert told.variance_db2 == pytest.approx(values.var(), abs=1e-9)
    assert told.variance_db2 >= 0.0
    assert min(rssi_dbm) <= told.time_ns <= max(rssi_dbm)
    assert told.sample_count == len(values)
