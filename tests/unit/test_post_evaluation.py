"""The score card: known errors come out as they are, and what is missing as none."""

from __future__ import annotations

import math
from collections.abc import Callable

import msgspec
import numpy as np
import pytest

from command_post.confidence import inside95
from command_post.evaluation.errors import RunErrors, measure
from command_post.evaluation.evidence import Evidence, Track
from command_post.evaluation.pooled import pool
from command_post.evaluation.resampling_runs import Redrawn
from command_post.evaluation.score_card import Radii, Score, score
from shared.messages import DapEstimate, LocalPosition, Message, TrackEstimate
from shared.topics import Key, Role
from tests.stride_world import at_ns, installation, key_of, stride, track_start, truth

Place = tuple[float, float]
Said = tuple[Role, str, Message]

METHOD_FIELDS = ("abs", "pair", "pair_unturned", "team", "end_m", "vertical_m")


def estimate(time_s: float, name: str, place: Place, sequence: int, var_m2: float = 1.0) -> Said:
    said = TrackEstimate(
        event_time_ns=at_ns(time_s), sequence=sequence, responder_id=name,
        north_m=place[0], east_m=place[1], down_m=0.5, covariance_m2=(var_m2, 0.0, var_m2),
        heading_rad=0.0, heading_sd_rad=0.1, last_proximity_time_ns=None,
    )  # fmt: skip
    return "post", "post", said


def dap_estimate(dap_id: str, place: Place, sequence: int = 0) -> Said:
    position = LocalPosition(
        north_m=place[0], east_m=place[1], down_m=0.0, covariance_m2=(1.0, 0.0, 1.0)
    )
    said = DapEstimate(
        event_time_ns=at_ns(1.0), sequence=sequence, dap_id=dap_id, position=position
    )
    return "post", "post", said


def north_walk(name: str, seconds: int) -> list[Said]:
    return [("responder", name, truth(t, (1.2 * t, 0.0), t)) for t in range(seconds + 1)]


def told(name: str, seconds: int, error: Callable[[float, float], Place]) -> list[Said]:
    """Estimates of the same walk, each place made wrong by ``error``."""
    return [estimate(t, name, error(1.2 * t, 0.0), t) for t in range(seconds + 1)]


def aside(name: str, seconds: int) -> list[Said]:
    """Somebody who stands eight metres east."""
    return [("responder", name, truth(t, (0.0, 8.0), t)) for t in range(seconds + 1)]


def told_aside(name: str, seconds: int, error: Callable[[float, float], Place]) -> list[Said]:
    return [estimate(t, name, error(0.0, 8.0), t) for t in range(seconds + 1)]


def evidence(*said: Said) -> Evidence:
    collected = Evidence()
    for role, node_id, message in said:
        collected.add(key_of(role, node_id, type(message)), message)
    return collected


def card(*said: Said) -> Score:
    return score(measure(evidence(*said)))


def test_a_constant_error_is_its_own_circular_error() -> None:
    live = card(*north_walk("r1", 20), *told("r1", 20, lambda n, e: (n + 3.0, e + 4.0))).live
    assert live.absolute is not None
    assert (live.absolute.ce50_m, live.absolute.ce95_m) == pytest.approx((5.0, 5.0))
    assert live.end_m == pytest.approx(5.0)
    assert live.vertical_m == pytest.approx(0.5)
    assert live.pair is None


def test_the_teams_rotation_is_taken_out_about_the_first_dap() -> None:
    turn = math.radians(20.0)

    def turned(north_m: float, east_m: float) -> Place:
        north_m, east_m = north_m - 2.0, east_m - 1.0
        return (
            2.0 + math.cos(turn) * north_m - math.sin(turn) * east_m,
            1.0 + math.sin(turn) * north_m + math.cos(turn) * east_m,
        )

    live = card(
        ("dap", "dap1", truth(0.0, (2.0, 1.0))),
        ("dap", "dap1", installation(0.0, None, (2.0, 1.0))),
        *north_walk("r1", 30), *told("r1", 30, turned),
        *north_walk("r2", 40)[5:], *told("r2", 40, turned)[5:],
        *aside("r3", 30), *told_aside("r3", 30, turned),
    ).live  # fmt: skip
    assert live.absolute is not None
    assert live.team is not None
    assert live.pair is not None
    assert live.pair_unturned is not None
    assert live.absolute.ce95_m > 8.0
    assert live.team.ce95_m == pytest.approx(0.0, abs=1e-6)
    assert live.pair_unturned.ce95_m > 0.5
    assert live.pair.ce95_m == pytest.approx(0.0, abs=1e-6)


def test_pairs_are_scored_by_the_vector_between_them() -> None:
    live = card(
        *north_walk("r1", 20), *told("r1", 20, lambda n, e: (n + 5.0, e)),
        *north_walk("r2", 20), *told("r2", 20, lambda n, e: (n + 5.0, e + 2.0)),
    ).live  # fmt: skip
    assert live.pair_unturned is not None
    assert (live.pair_unturned.ce50_m, live.pair_unturned.ce95_m) == pytest.approx((2.0, 2.0))


def test_dead_reckoning_sums_the_increments_from_the_start() -> None:
    strides: list[Said] = [
        ("responder", "r1", stride(t, 1.2, 0.3, sequence=t)) for t in range(1, 11)
    ]
    pdr = card(*north_walk("r1", 10), ("responder", "r1", track_start(0.0)), *strides).pdr
    assert pdr.end_m == pytest.approx(3.0)
    assert pdr.absolute is not None
    assert pdr.absolute.ce50_m == pytest.approx(1.5)


def test_a_new_start_begins_dead_reckoning_again() -> None:
    track = evidence(
        ("responder", "r1", track_start(0.0)),
        ("responder", "r1", stride(1.0, 1.0, 0.0)),
        ("responder", "r1", track_start(5.0, sequence=1)),
        ("responder", "r1", stride(6.0, 0.0, 1.0, sequence=1)),
    ).tracks("pdr")["r1"]
    seconds = np.array([0.0, 1.0, 5.0, 6.0]) + at_ns(0.0) / 1e9
    place_m = track.at(seconds).position_m[:, :2]
    np.testing.assert_allclose(place_m, [(0, 0), (1, 0), (0, 0), (0, 1)])


def test_a_track_that_stops_is_held_to_the_end_of_the_truth() -> None:
    live = card(*north_walk("r1", 30), *told("r1", 10, lambda n, e: (n, e))).live
    assert live.end_m == pytest.approx(24.0)


def test_coverage_is_the_share_of_time_inside() -> None:
    within = told("r1", 9, lambda n, e: (n + 2.0, e))
    without = [estimate(t, "r1", (1.2 * t + 3.0, 0.0), t) for t in range(10, 20)]
    assert card(*north_walk("r1", 19), *within, *without).coverage95_pct == pytest.approx(50.0)


def test_inside_follows_the_ellipses_shape() -> None:
    errors = np.array([[4.0, 0.0], [0.0, 4.0], [1.0, 1.0], [1.0, -1.0], [0.0, 0.0], [0.1, 0.0]])
    covariance = np.array([(4, 0, 1), (4, 0, 1), (1, 0.99, 1), (1, 0.99, 1), (0, 0, 0), (0, 0, 0)])
    assert inside95(errors, covariance).tolist() == [True, False, True, False, True, False]


def test_daps_that_somebody_set_down_are_scored() -> None:
    dap = card(
        ("dap", "dap1", truth(0.0, (0.0, 0.0))),
        ("dap", "dap1", installation(0.0, None, (0.0, 0.0))),
        dap_estimate("dap1", (0.0, 0.0)),
        ("dap", "dap2", truth(0.0, (10.0, 0.0))),
        ("dap", "dap2", installation(1.0, "r1")),
        dap_estimate("dap2", (13.0, 4.0), sequence=1),
        dap_estimate("dap3", (99.0, 99.0), sequence=2),
    ).dap
    assert dap is not None
    assert dap.each_m == {"dap2": pytest.approx(5.0)}


def test_nothing_is_none_and_never_nought() -> None:
    empty = card()
    assert msgspec.to_builtins(empty) == {
        "pdr": dict.fromkeys(METHOD_FIELDS),
        "live": dict.fromkeys(METHOD_FIELDS),
        "after": None,
        "dap": None,
        "coverage95_pct": None,
        "responders": {},
    }
    only_truth = card(*north_walk("r1", 5))
    assert only_truth == empty
    only_track = card(*told("r1", 5, lambda n, e: (n, e)))
    assert only_track == empty


def test_a_track_after_the_truth_ended_is_not_scored() -> None:
    later = [estimate(100.0 + t, "r1", (0.0, 0.0), t) for t in range(5)]
    assert card(*north_walk("r1", 20), *later).live.absolute is None


def test_evidence_may_come_in_any_order_and_twice() -> None:
    said: list[Said] = [
        *north_walk("r1", 20), *told("r1", 20, lambda n, e: (n + 1.0, e)),
        ("responder", "r1", track_start(0.0)), ("responder", "r1", stride(3.0, 1.0, 0.0)),
        ("dap", "dap2", truth(0.0, (10.0, 0.0))), dap_estimate("dap2", (13.0, 4.0)),
    ]  # fmt: skip
    numbers = np.random.Generator(np.random.Philox(3))
    shuffled = [said[k] for k in numbers.permutation(2 * len(said)) % len(said)]
    assert card(*shuffled) == card(*said)


def test_runs_are_thrown_together() -> None:
    def run(error_m: float) -> RunErrors:
        return measure(
            evidence(*north_walk("r1", 99), *told("r1", 99, lambda n, e: (n, e + error_m)))
        )

    good, bad = run(1.0), run(20.0)
    pooled = msgspec.to_builtins(pool({"course": [good, good, good, bad], "none": []}))
    course = pooled["scenarios"]["course"]
    assert course["runs"] == 4
    assert course["live"]["abs"] == {"ce50_m": pytest.approx(1.0), "ce95_m": pytest.approx(20.0)}
    assert course["live"]["fail_pct"] == pytest.approx(25.0)
    assert course["live"]["coverage95_pct"] == pytest.approx(75.0)
    assert course["live"]["dap"] is None
    assert course["live"]["wrong_floor_pct"] is None
    assert course["after"] is None
    assert course["live"].keys() == course["pdr"].keys()
    empty = course["pdr"].pop("intervals")
    assert set(course["pdr"].values()) == set(empty.values()) == {None}
    assert pooled["scenarios"]["none"]["live"]["abs"] is None


def test_what_is_sure_over_runs_has_a_narrow_interval() -> None:
    errors_m = [np.full(50, 1.0)] * 60 + [np.full(50, 9.0)] * 40
    ((low, high), (low95, high95)) = Redrawn(100).percentiles(errors_m, (50.0, 95.0))
    assert low == pytest.approx(1.0, abs=0.01)
    assert high in (pytest.approx(1.0, abs=0.01), pytest.approx(9.0, abs=0.01))
    assert (low95, high95) == pytest.approx((9.0, 9.0), abs=0.01)
    low, high = Redrawn(100).share_pct([0] * 60 + [1] * 40, [1] * 100)
    # A share of 40 % of 100 has a standard error of 4.9 %.
    assert low == pytest.approx(40.0 - 1.96 * 4.9, abs=1.5)
    assert high == pytest.approx(40.0 + 1.96 * 4.9, abs=1.5)
    assert Redrawn(3).share_pct([1, 0, 1], [1, 0, 1]) == (100.0, 100.0)


def smoothed(error_m: float) -> Track:
    time_s = np.array([at_ns(0.0), at_ns(99.0)]) / 1e9
    place_m = np.array([[0.0, error_m, 0.0], [1.2 * 99.0, error_m, 0.0]])
    return Track(time_s, place_m, np.tile([1.0, 0.0, 1.0], (2, 1)))


def test_what_was_made_of_it_afterwards_is_scored_beside() -> None:
    def run(error_m: float) -> RunErrors:
        collected = evidence(
            *north_walk("r1", 99), *told("r1", 99, lambda n, e: (n, e)),
            ("dap", "dap2", truth(0.0, (10.0, 0.0))), dap_estimate("dap2", (13.0, 4.0)),
        )  # fmt: skip
        collected.add_afterwards({"r1": smoothed(error_m)}, {"dap2": np.array([10.0, 0.5, 0.0])})
        return measure(collected)

    pooled = pool({"course": [run(0.5), run(1.5)]}).scenarios["course"]
    assert pooled.after is not None
    after = msgspec.to_builtins(pooled.after)
    assert after["abs"] == {"ce50_m": pytest.approx(1.0), "ce95_m": pytest.approx(1.5)}
    assert after["dap"] == {"ce50_m": pytest.approx(0.5), "ce95_m": pytest.approx(0.5)}
    assert pooled.after.nees is not None
    assert pooled.after.nees.mean == pytest.approx(0.5 * (0.25 + 2.25))
    assert pooled.live.dap == Radii(5.0, 5.0)
    assert score(run(0.5)).after is not None


def test_many_peaked_estimates_are_scored_by_their_outlines() -> None:
    here = ((-1.0, -1.0), (-1.0, 1.0), (1.0, 1.0), (1.0, -1.0))
    there = tuple((north, east + 8.0) for north, east in here)
    far = tuple((north + 50.0, east) for north, east in here)
    said = []
    for t, outlines in enumerate([(far, there), (here, far), (far,), (there,)]):
        role, post, plain = estimate(t, "r1", (4.0, 4.0), t, var_m2=100.0)
        assert isinstance(plain, TrackEstimate)
        said.append((role, post, msgspec.structs.replace(plain, regions_m=outlines)))
    assert card(*aside("r1", 3), *said).coverage95_pct == pytest.approx(50.0)


def test_floors_are_told_wrong_only_while_one_is_on_a_floor() -> None:
    downs_m = [0.0, 0.0, -1.7, -3.3, -3.3, -6.6]
    stairs: list[Said] = [
        ("responder", "r1", msgspec.structs.replace(truth(t, (0.0, 0.0), t), down_m=down_m))
        for t, down_m in enumerate(downs_m)
    ]
    half_a_metre_below = [estimate(t, "r1", (0.0, 0.0), t) for t in range(6)]
    errors = measure(evidence(*stairs, *half_a_metre_below), np.array([-6.6, 0.0, -3.3]))
    off = errors.live.responders["r1"].floors_off
    assert off is not None
    assert off.tolist() == [0, 0, -1, 1, 1, 2]
    pooled = pool({"x": [errors]}).scenarios["x"].live
    assert pooled.wrong_floor_pct == pytest.approx(60.0)
    assert pooled.ipin_m == pytest.approx(15.0)


def test_the_gradient_is_how_fast_the_error_grows() -> None:
    drifting = told("r1", 50, lambda n, e: (n, e + n / 12))
    run = measure(evidence(*north_walk("r1", 50), *drifting))
    assert pool({"x": [run]}).scenarios["x"].live.eag_m_s == pytest.approx(0.1)


def test_a_key_names_whose_truth_it_is() -> None:
    collected = Evidence()
    collected.add(Key("exercise", "dap", "x", "truth"), truth(0.0, (1.0, 2.0)))
    assert collected.truth("x") is None
    assert collected.responders() == []
    assert collected.dap_truths_m()["x"].tolist() == [1.0, 2.0, 0.0]


def test_who_stands_before_a_ride_is_not_on_the_way_all_the_while() -> None:
    ride = msgspec.structs.replace(
        stride(30.0, 0.0, 0.0, sequence=2, d_down_m=-3.0), start_time_ns=at_ns(20.0)
    )
    role, node_id, told_up = estimate(30.0, "r1", (1.0, 0.0), 2)
    said = evidence(
        ("responder", "r1", track_start(0.0)),
        ("responder", "r1", stride(1.0, 1.0, 0.0, sequence=1)),
        ("responder", "r1", ride),
        estimate(1.0, "r1", (1.0, 0.0), 1),
        (role, node_id, msgspec.structs.replace(told_up, down_m=-2.5)),
    )
    seconds = np.array([10.0, 19.0, 25.0]) + at_ns(0.0) / 1e9
    for tracks, from_m in ((said.tracks("pdr"), 0.0), (said.tracks("live"), 0.5)):
        down_m = tracks["r1"].at(seconds).position_m[:, 2]
        np.testing.assert_allclose(down_m, [from_m, from_m, from_m - 1.5], atol=1e-5)
