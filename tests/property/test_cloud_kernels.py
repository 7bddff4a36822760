"""The compiled cloud against its plain meaning, and what no cloud may break."""

from __future__ import annotations

import math
from hashlib import sha256
from statistics import NormalDist

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from command_post.fusion.cloud.chance import Key, responder_stream, step_key
from command_post.fusion.cloud.cloud import (
    Cloud,
    Moments,
    Step,
    advance,
    from_bytes,
    moments,
    move,
    places,
    resample,
    spawn,
    tie,
    to_bytes,
)
from command_post.fusion.cloud.cloud_plain import (
    DRIFT,
    LOG_SCALE,
    OFFSET,
    WEIGHT,
    Floats,
    loosen_plain,
    moments_plain,
    move_plain,
    plain_cloud,
    source_plain,
    spawn_plain,
    tie_plain,
)
from command_post.fusion.cloud.layout import BLOCK, FIELDS, LANES, TIE_WIDTH
from command_post.fusion.cloud.model import CloudModel, Mixture, Tie
from command_post.fusion.cloud.noise import CHANCE, CHANCES, NORMAL, PLACES
from command_post.fusion.cloud.packing import component_rows, lower_root, step_row, tie_row
from shared.messages import OdometryIncrement

seeds = st.integers(0, 2**32 - 1)
keys = st.builds(Key, seeds, seeds)
WILD = CloudModel(jump_share=0.3, missed_share=0.3, drift_walk_rad_s=0.01, resample_below=1.0)


def random_mixture(rng: np.random.Generator) -> Mixture:
    many = int(rng.integers(1, 5))
    roots = rng.standard_normal((many, 5, 5)) * np.array([3.0, 3.0, 0.5, 0.02, 0.001])[:, None]
    roots[0, 2] *= rng.choice([1.0, 20.0])
    means = rng.standard_normal((many, 5)) * [20.0, 20.0, 1.0, 0.02, 0.001]
    return Mixture(rng.random(many) + 0.1, means, roots @ roots.transpose(0, 2, 1))


def random_increment(rng: np.random.Generator) -> OdometryIncrement:
    root = rng.standard_normal((4, 4)) * np.array([0.05, 0.05, 0.02, 0.02])[:, None]
    covariance = tuple((root @ root.T)[np.triu_indices(4)].tolist())
    return OdometryIncrement(
        event_time_ns=2_000_000_000, start_time_ns=int(rng.integers(0, 2_000_000_000)), sequence=1,
        d_north_m=rng.normal(), d_east_m=rng.normal(), d_down_m=0.0, d_heading_rad=0.1,
        heading_rad=0.1, covariance=covariance, mount="boot",
    )  # fmt: skip


def random_ties(rng: np.random.Generator, many: int) -> list[Tie]:
    return [
        Tie(
            north_m=rng.normal(0.0, 20.0),
            east_m=rng.normal(0.0, 20.0),
            covariance_m2=(rng.uniform(0.1, 4.0), rng.uniform(-0.1, 0.1), rng.uniform(0.1, 4.0)),
            sd_m=rng.uniform(0.5, 5.0),
            dof=float(rng.choice([1.0, 4.0])),
            since_m=(rng.normal(0.0, 2.0), rng.normal(0.0, 2.0)),
        )
        for _ in range(many)
    ]


def random_cloud(rng: np.random.Generator, count: int = 256) -> Cloud:
    """A cloud with weights as uneven as a few ties leave them."""
    cloud = spawn(random_mixture(rng), count, Key(*rng.integers(0, 2**32, 2).tolist()))
    return tie(cloud, random_ties(rng, 2))[0]


def assert_same_state(cloud: Cloud, expected: Floats) -> None:
    actual = plain_cloud(cloud.lanes)
    across = np.abs(actual[OFFSET] - expected[OFFSET])
    np.testing.assert_allclose(np.minimum(across, 2 * math.pi - across), 0.0, atol=3e-6)
    others = [0, 1, DRIFT, LOG_SCALE]
    np.testing.assert_allclose(actual[others], expected[others], rtol=2e-6, atol=3e-5)
    np.testing.assert_allclose(actual[WEIGHT], expected[WEIGHT], rtol=3e-5)
    derived = cloud.lanes.reshape(-1, FIELDS, LANES)[:, 6:].transpose(1, 0, 2).reshape(3, -1)
    meant = [np.cos(actual[OFFSET]), np.sin(actual[OFFSET]), np.exp(actual[LOG_SCALE])]
    np.testing.assert_allclose(derived, meant, rtol=1e-6, atol=4e-7)


def assert_same_moments(told: Moments, cloud: Cloud, expected: Floats) -> None:
    meant = moments_plain(expected)
    place = np.array([told.north_m, told.east_m]) - cloud.origin_m
    spread = math.sqrt(meant.covariance_m2[0] + meant.covariance_m2[2])
    np.testing.assert_allclose(place, meant.place_m, atol=1e-5 * (1.0 + spread))
    np.testing.assert_allclose(
        told.covariance_m2, meant.covariance_m2, rtol=1e-4, atol=4e-5 * (1.0 + spread) ** 2
    )
    assert math.cos(told.offset_rad - meant.offset_rad) > 1.0 - 1e-6
    assert told.offset_sd_rad == pytest.approx(meant.offset_sd_rad, rel=1e-3, abs=2e-3)
    assert told.effective_count == pytest.approx(meant.effective_count, rel=1e-4)


@settings(max_examples=30, deadline=None)
@given(seeds, keys)
def test_spawning_is_its_plain_meaning(seed: int, key: Key) -> None:
    mixture = random_mixture(np.random.default_rng(seed))
    cloud = spawn(mixture, 250, key)
    assert cloud.particle_count == 256
    expected = spawn_plain(256, component_rows(mixture, cloud.origin_m), key)
    # A particle on the very bound of two components may be either's.
    same = np.abs(plain_cloud(cloud.lanes)[LOG_SCALE] - expected[LOG_SCALE]) < 1e-5
    assert same.sum() >= 255
    expected[:, ~same] = plain_cloud(cloud.lanes)[:, ~same]
    assert_same_state(cloud, expected)


@settings(max_examples=30, deadline=None)
@given(seeds, keys, st.integers(0, 3))
def test_moving_is_its_plain_meaning(seed: int, key: Key, lost: int) -> None:
    rng = np.random.default_rng(seed)
    cloud, increment = random_cloud(rng), random_increment(rng)
    row = np.array(step_row(increment, lost, 256, WILD), np.float32)
    expected = move_plain(plain_cloud(cloud.lanes), row, key)
    assert_same_state(move(cloud, increment, key, lost, WILD), expected)


@settings(max_examples=30, deadline=None)
@given(seeds, st.integers(0, 12))
def test_tying_is_its_plain_meaning(seed: int, many: int) -> None:
    rng = np.random.default_rng(seed)
    cloud, ties = random_cloud(rng), random_ties(rng, many)
    rows = np.array([tie_row(each, cloud.origin_m) for each in ties], np.float32)
    rows = rows.reshape(many, TIE_WIDTH)
    expected, evidence = tie_plain(plain_cloud(cloud.lanes), rows)
    tied, told = tie(cloud, ties)
    assert told == pytest.approx(evidence, rel=1e-5, abs=1e-4)
    assert_same_state(tied, expected)
    assert_same_moments(moments(tied), tied, expected)


@settings(max_examples=30, deadline=None)
@given(seeds, keys)
def test_resampling_is_its_plain_meaning(seed: int, key: Key) -> None:
    cloud = random_cloud(np.random.default_rng(seed))
    before = plain_cloud(cloud.lanes)
    drawn = resample(cloud, key, CloudModel(resample_below=1.0, kept_spread=1.0))
    source = source_plain(before, key)
    expected = before[:, source]
    expected[WEIGHT] = 1.0 / 256
    same = np.abs(plain_cloud(drawn.lanes) - expected).max(axis=0) < 1e-5
    assert same.sum() >= 254
    loosened = resample(cloud, key, CloudModel(resample_below=1.0, kept_spread=0.9))
    assert_same_state(loosened, loosen_plain(plain_cloud(drawn.lanes), 0.9, key))


@settings(max_examples=30, deadline=None)
@given(seeds, keys)
def test_copies_go_by_weight(seed: int, key: Key) -> None:
    cloud = random_cloud(np.random.default_rng(seed))
    drawn = resample(cloud, key, CloudModel(resample_below=1.0, kept_spread=1.0))
    before, after = plain_cloud(cloud.lanes), plain_cloud(drawn.lanes)
    expected = 256 * before[WEIGHT]
    copies = (after[:5, None, :] == before[:5, :, None]).all(axis=0).sum(axis=1)
    assert copies.sum() == 256
    assert np.all(np.abs(copies - expected) < 1.0 + 1e-3)


def test_resampling_keeps_expectations() -> None:
    cloud = random_cloud(np.random.default_rng(5))
    weights = plain_cloud(cloud.lanes)[WEIGHT]
    mean = plain_cloud(cloud.lanes)[:5] @ weights
    model = CloudModel(resample_below=1.0)
    draws = [
        plain_cloud(resample(cloud, step_key(7, step), model).lanes)[:5].mean(axis=1)
        for step in range(400)
    ]
    error = np.std(draws, axis=0) / math.sqrt(len(draws))
    assert np.all(np.abs(np.mean(draws, axis=0) - mean) < 4.0 * error + 1e-6)


@settings(max_examples=20, deadline=None)
@given(seeds, keys)
def test_weights_sum_to_one_and_headings_stay_within_a_turn(seed: int, key: Key) -> None:
    rng = np.random.default_rng(seed)
    cloud, told = random_cloud(rng), []
    for _ in range(5):
        step = Step(key, random_increment(rng), 0, random_ties(rng, 3))
        cloud, (one,) = advance(cloud, [step])
        told.append(one)
    assert places(cloud)[2].sum() == pytest.approx(1.0, abs=1e-5)
    assert np.abs(plain_cloud(cloud.lanes)[OFFSET]).max() <= math.pi + 1e-6
    assert all(1.0 - 1e-3 <= one.effective_count <= 256.1 for one in told)
    assert all(abs(one.covariance_m2[1]) < 1e6 for one in told)


@settings(max_examples=20, deadline=None)
@given(seeds)
def test_the_order_of_ties_does_not_matter(seed: int) -> None:
    rng = np.random.default_rng(seed)
    cloud, ties = random_cloud(rng), random_ties(rng, 4)
    forwards, backwards = tie(cloud, ties), tie(cloud, ties[::-1])
    assert forwards[1] == pytest.approx(backwards[1], rel=1e-5, abs=1e-4)
    np.testing.assert_allclose(
        plain_cloud(forwards[0].lanes), plain_cloud(backwards[0].lanes), rtol=1e-5, atol=1e-4
    )


def many_steps(rng: np.random.Generator) -> list[Step]:
    stream = responder_stream(3, "r1")
    return [
        Step(step_key(stream, n), random_increment(rng), 0, random_ties(rng, n % 3))
        for n in range(20)
    ]


def test_all_at_once_one_by_one_and_resumed_midway_are_the_same_bits() -> None:
    rng = np.random.default_rng(1)
    cloud, steps = random_cloud(rng), many_steps(rng)
    at_once, told = advance(cloud, steps)
    assert any(each.resampled for each in told)
    single, singly = cloud, []
    for step in steps:
        single, (one,) = advance(single, [step])
        single = from_bytes(to_bytes(single))
        singly.append(one)
    assert to_bytes(at_once) == to_bytes(single)
    assert told == singly


def test_no_operation_writes_to_the_cloud_it_is_given() -> None:
    rng = np.random.default_rng(2)
    cloud = random_cloud(rng)
    before = to_bytes(cloud)
    advance(cloud, many_steps(rng))
    assert to_bytes(cloud) == before
    with pytest.raises(ValueError, match="read-only"):
        cloud.lanes[0] = 1.0


def test_random_numbers_are_normal_and_of_no_pattern() -> None:
    at_origin = Mixture(np.ones(1), np.zeros((1, 5)), np.eye(5)[None] * 0.5)
    stream = responder_stream(1, "r1")
    drawn = np.stack(
        [
            plain_cloud(spawn(at_origin, 4096, step_key(stream, step)).lanes)[:5]
            for step in range(40)
        ]
    ) / math.sqrt(0.5)
    count = drawn[:, 0].size
    assert np.all(np.abs(drawn.mean(axis=(0, 2))) < 4.0 / math.sqrt(count))
    np.testing.assert_allclose((drawn**2).mean(axis=(0, 2)), 1.0, atol=0.015)
    np.testing.assert_allclose((drawn[:, [0, 1, 3, 4]] ** 4).mean(axis=(0, 2)), 3.0, atol=0.12)
    flat = drawn.transpose(1, 0, 2).reshape(5, -1)
    assert np.abs(np.corrcoef(flat) - np.eye(5)).max() < 4.5 / math.sqrt(count)
    for apart in (1, 2, 64):
        beside = (drawn[:, :, apart:] * drawn[:, :, :-apart]).mean(axis=(0, 2))
        assert np.abs(beside).max() < 4.5 / math.sqrt(count)
    between = (drawn[1:] * drawn[:-1]).mean(axis=(0, 2))
    assert np.abs(between).max() < 4.5 / math.sqrt(count)


def test_noise_of_strides_is_normal_and_of_no_pattern() -> None:
    still = CloudModel(heading_sd_rad=0.02, jump_share=0.0, missed_share=0.0)
    at_origin = spawn(Mixture(np.ones(1), np.zeros((1, 5)), np.zeros((1, 5, 5))), 4096, Key(1, 1))
    stream, stand = responder_stream(1, "r1"), random_increment(np.random.default_rng(1))
    stand = msgspec.structs.replace(stand, d_north_m=0.0, d_east_m=0.0, covariance=(0.0,) * 10)
    moves = [move(at_origin, stand, step_key(stream, step), 0, still) for step in range(40)]
    drawn = np.stack([plain_cloud(moved.lanes)[:4] for moved in moves])
    elapsed_s = (stand.event_time_ns - stand.start_time_ns) / 1e9
    drawn[:, 2] -= elapsed_s * drawn[:, 3]
    drawn /= np.array([0.02, 0.02, 0.02, still.drift_walk_rad_s * math.sqrt(elapsed_s)])[:, None]
    count = drawn[:, 0].size
    assert np.all(np.abs(drawn.mean(axis=(0, 2))) < 4.0 / math.sqrt(count))
    np.testing.assert_allclose((drawn**2).mean(axis=(0, 2)), 1.0, atol=0.015)
    np.testing.assert_allclose((drawn**4).mean(axis=(0, 2)), 3.0, atol=0.12)
    flat = drawn.transpose(1, 0, 2).reshape(4, -1)
    assert np.abs(np.corrcoef(flat) - np.eye(4)).max() < 4.5 / math.sqrt(count)
    for apart in (1, 2, 63, 64):
        beside = (drawn[:, :, apart:] * drawn[:, :, :-apart]).mean(axis=(0, 2))
        assert np.abs(beside).max() < 4.5 / math.sqrt(PLACES)
    between = (drawn[1:] * drawn[:-1]).mean(axis=(0, 2))
    assert np.abs(between).max() < 4.5 / math.sqrt(count)


def test_the_table_of_noise_is_normal() -> None:
    for table in (NORMAL, CHANCE):
        assert table[:LANES].tobytes() == table[PLACES:].tobytes()
    ordered = np.sort(NORMAL[:PLACES].astype(np.float64))
    meant = [NormalDist().inv_cdf((i + 0.5) / PLACES) for i in range(PLACES)]
    np.testing.assert_allclose(ordered, meant, rtol=1e-3, atol=1e-4)
    assert ordered.mean() == 0.0
    assert (ordered**2).mean() == pytest.approx(1.0, abs=1e-6)
    assert (np.sort(CHANCE[:PLACES]) == np.arange(4, CHANCES, 8)).all()
    bits = sha256(NORMAL.astype("<f4").tobytes() + CHANCE.astype("<f4").tobytes()).hexdigest()
    assert bits.startswith("9a04c348f87b0c67"), "recordings are made again with these very numbers"


def test_keys_tell_responders_steps_and_uses_apart() -> None:
    streams = [responder_stream(seed, name) for seed in (1, 2) for name in ("r1", "r2")]
    told = {step_key(each, step, use) for each in streams for step in range(50) for use in range(3)}
    assert len(told) == 4 * 50 * 3


@given(seeds)
def test_a_root_gives_its_covariance_back(seed: int) -> None:
    root = np.random.default_rng(seed).standard_normal((5, 5))
    told = root @ root.T
    found = np.array(lower_root(told.tolist()))
    np.testing.assert_allclose(found @ found.T, told, atol=1e-9)


def test_no_told_covariance_is_too_odd_for_a_root() -> None:
    odd = [[1.0, 5.0, 0.0], [5.0, 1.0, -9.0], [0.0, -9.0, -2.0]]
    assert np.all(np.isfinite(lower_root(odd)))


def test_what_is_no_mixture_is_refused() -> None:
    with pytest.raises(ValueError, match="a mixture is k weights"):
        spawn(Mixture(np.ones(2), np.zeros((2, 3)), np.zeros((2, 3, 3))), 64, Key(1, 2))
    with pytest.raises(ValueError, match="must not be negative"):
        spawn(Mixture(np.zeros(1), np.zeros((1, 4)), np.eye(4)[None]), 64, Key(1, 2))
    with pytest.raises(ValueError, match="at least one particle"):
        spawn(Mixture(np.ones(1), np.zeros((1, 4)), np.eye(4)[None]), 0, Key(1, 2))
    with pytest.raises(ValueError, match="no saved cloud"):
        from_bytes(b"\0" * (16 + 4 * BLOCK - 1))
    cloud = random_cloud(np.random.default_rng(1))
    with pytest.raises(ValueError, match="degrees of freedom"):
        tie(cloud, [Tie(0.0, 0.0, (1.0, 0.0, 1.0), 1.0, dof=0.0)])
