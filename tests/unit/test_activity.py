"""What a stride was: told apart on simulated gaits, and on real recordings by true speed."""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pytest

from edge_agent.evaluation.truth import Truth
from edge_agent.inertial.activity import ActivityClassifier, ActivityEstimate
from edge_agent.inertial.stride_error import Covariance4
from edge_agent.mounts.interface import Increment
from edge_agent.mounts.methods import make_mount
from edge_agent.sources.npz_set import read_npz_set
from shared.messages import Activity, ImuSample
from shared.simulation.boot_imu import simulate_boot_imu
from shared.simulation.legs import Gait
from shared.simulation.scenario import load_scenario
from shared.simulation.walker import simulate_walk
from shared.units import NS_PER_S

SHORTEST_STRIDE_M = 0.3
"""Turning on the spot and kneeling down are not strides of their gait."""

NAMES: dict[Gait, Activity] = {
    "walk": "walk",
    "fast_walk": "fast",
    "side_left": "side_step",
    "side_right": "side_step",
    "crawl": "crawl",
    "stairs_up": "stairs_up",
    "stairs_down": "stairs_down",
    "ladder": "ladder",
    "lift": "lift",
}
LOST: Covariance4 = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0)
KNOWN: Covariance4 = (1e-4, 0.0, 0.0, 0.0, 1e-4, 0.0, 0.0, 0.0, 0.0, 0.0)

Named = list[tuple[Increment, ActivityEstimate]]


def named(samples: Iterable[ImuSample]) -> Named:
    mount, classifier = make_mount("boot", "eskf"), ActivityClassifier()
    found: Named = []
    for sample in samples:
        classifier.take_sample(sample)
        increment = mount.step(sample)
        if increment is not None:
            found.append((increment, classifier.take_increment(increment)))
    return found


def middle_s(increment: Increment) -> float:
    return (increment.start_time_ns + increment.end_time_ns) / 2 / NS_PER_S


@pytest.mark.parametrize("scenario", ["course", "stairwell", "tower"])
def test_simulated_gaits_are_told_apart(scenario: str) -> None:
    exercise = load_scenario(scenario)
    right: dict[Gait, list[bool]] = defaultdict(list)
    for responder_id in exercise.responders:
        walk = simulate_walk(exercise, responder_id, 7)
        for increment, estimate in named(simulate_boot_imu(exercise, responder_id, 7).samples(0)):
            stride = int(np.searchsorted(walk.stance_time_s, middle_s(increment))) - 1
            moved = math.hypot(*increment.displacement_m) > SHORTEST_STRIDE_M
            in_walk = 0 <= stride < len(walk.gaits)
            if moved and in_walk and walk.stride_m[stride] > SHORTEST_STRIDE_M:
                gait = walk.gaits[stride]
                right[gait].append(estimate.activity == NAMES[gait])
    assert right
    for gait, told in right.items():
        assert np.mean(told) >= 0.9, gait


def test_speeds_of_real_strides_are_told_apart(data_dir: Path) -> None:
    table: dict[str, Counter[Activity]] = defaultdict(Counter)
    for name in ("walk_31", "mixed_52", "mixed_54", "mixed_60", "mixed_68"):
        recording, truth = read_npz_set(data_dir / "foot_strides" / f"{name}.npz")
        assert isinstance(truth, Truth)
        speed_m_s = truth.stride_lengths_m / np.diff(truth.time_s)
        for increment, estimate in named(recording):
            stride = int(np.searchsorted(truth.time_s, middle_s(increment))) - 1
            if 0 <= stride < len(speed_m_s):
                # A tenth of a metre per second about the limits is nobody's error.
                for true, low, high in (("walk", 0.7, 1.2), ("fast", 1.4, 1.8), ("run", 2.0, 9)):
                    if low < speed_m_s[stride] < high:
                        table[true][estimate.activity] += 1
    assert set(table) == {"walk", "fast", "run"}
    for true, told in table.items():
        right = sum(count for activity, count in told.items() if activity == true)
        assert right >= 0.85 * told.total(), (true, told)


def test_rungs_are_no_stairs(data_dir: Path) -> None:
    recording, _ = read_npz_set(data_dir / "foot_vicon" / "2018-02-09-11-16-53.npz")
    told = Counter(estimate.activity for _, estimate in named(recording))
    assert told["ladder"] >= 10
    assert set(told) == {"ladder", "stand"}


def stride_of(
    classifier: ActivityClassifier,
    displacement_m: tuple[float, float, float],
    start_s: float,
    *,
    force_m_s2: tuple[float, float, float] = (0.0, 0.0, -9.81),
    duration_s: float = 1.0,
    covariance: Covariance4 = KNOWN,
) -> ActivityEstimate:
    """Let the classifier see a stride of the boot facing north."""
    start_ns = round(start_s * NS_PER_S)
    end_ns = start_ns + round(duration_s * NS_PER_S)
    for time_ns in range(start_ns, end_ns + 1, NS_PER_S // 100):
        classifier.take_sample(ImuSample(time_ns, force_m_s2, (0.0, 5.0, 0.0)))
    increment = Increment(start_ns, end_ns, displacement_m, 0.0, 0.0, covariance, ())
    return classifier.take_increment(increment)


def test_aside_is_told_once_forward_is_known() -> None:
    classifier = ActivityClassifier()
    assert stride_of(classifier, (0.0, 0.6, 0.0), 0.0).activity == "walk"
    assert stride_of(classifier, (0.0, 1.2, 0.0), 1.0).activity == "walk"
    aside = stride_of(classifier, (-0.6, 0.0, 0.0), 2.0)
    assert aside.activity == "side_step"
    assert "left" not in aside.reason
    assert stride_of(classifier, (0.6, 0.0, 0.0), 3.0).reason.startswith("0.6 m to the left")


def test_a_boot_on_its_toes_crawls_however_far_it_goes() -> None:
    classifier = ActivityClassifier()
    stride_of(classifier, (1.2, 0.0, 0.0), 0.0)
    assert classifier.flat == pytest.approx((0.0, 0.0, -1.0))
    on_toes = (9.6, 0.0, -2.0)
    stride_of(classifier, (0.2, 0.0, 0.0), 1.0, force_m_s2=on_toes)
    told = stride_of(classifier, (0.6, 0.0, 0.0), 2.0, force_m_s2=on_toes)
    assert (told.activity, told.confidence > 0.9) == ("crawl", True)
    assert told.reason == "boot rests 78° from flat"


def test_a_lost_way_has_no_name() -> None:
    lost = stride_of(ActivityClassifier(), (1.0, 0.0, 0.0), 0.0, covariance=LOST)
    assert lost == ("unknown", 0.0, "the boot's way is lost")
    long = stride_of(ActivityClassifier(), (1.0, 0.0, 0.0), 0.0, duration_s=8.0)
    assert long.activity == "unknown"


def test_without_samples_nothing_is_named() -> None:
    increment = Increment(0, NS_PER_S, (1.2, 0.0, 0.0), 0.0, 0.0, KNOWN, ())
    assert ActivityClassifier().take_increment(increment).activity == "unknown"


def test_confidence_falls_towards_the_limit_between_two_activities() -> None:
    at = [
        stride_of(ActivityClassifier(), (speed_m_s, 0.0, 0.0), 0.0, duration_s=0.75)
        for speed_m_s in (1.0, 1.25, 1.35, 1.5)
    ]
    assert [one.activity for one in at] == ["walk", "walk", "fast", "fast"]
    assert at[0].confidence > at[1].confidence
    assert at[3].confidence > at[2].confidence
