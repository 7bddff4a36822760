"""Regions of known mixtures: whether they hold what they say, and no more outlines than told."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from command_post.fusion.cloud.chance import Key, step_key
from command_post.fusion.cloud.cloud import Cloud, moments, spawn, tie
from command_post.fusion.cloud.model import Mixture, Tie
from command_post.fusion.cloud.outlines import CORNERS, twice_area
from command_post.fusion.cloud.regions import (
    ELLIPSE_SCALE,
    MOST_OUTLINES,
    SHARE,
    regions,
    weight_within,
)
from command_post.fusion.track import MOST_COORDINATE_M
from shared.messages import Outline

Floats = NDArray[np.float64]

SEEDS = 8
DRAWN = 20_000


def peaks(weights: list[float], places: Floats, sds: Floats) -> Mixture:
    """A mixture of peaks, headings and scales well known."""
    many = len(weights)
    means, covariances = np.zeros((many, 4)), np.zeros((many, 4, 4))
    means[:, :2] = places
    covariances[:, [0, 1], [0, 1]] = np.broadcast_to(sds, (many, 2)) ** 2
    covariances[:, [2, 3], [2, 3]] = 0.01
    return Mixture(np.array(weights), means, covariances)


def around(turns: Floats, radius_m: float, sd_m: float) -> Mixture:
    """Peaks on a circle, so many that they make a band: a heading unknown, a distance known."""
    places = radius_m * np.stack([np.cos(turns), np.sin(turns)], axis=1)
    return peaks([1.0] * len(turns), places, np.array([sd_m, sd_m]))


MIXTURES = {
    "two alike": (peaks([1, 1], np.array([[0, 0], [20, 0]]), np.array([1.0, 1.0])), 2),
    "one faint": (peaks([9, 1], np.array([[0, 0], [0, 15]]), np.array([1.0, 1.5])), 2),
    "near": (peaks([1, 1], np.array([[0, 0], [6, 2]]), np.array([1.0, 1.0])), 2),
    "corridors": (
        peaks(
            [3, 2, 2, 1],
            np.array([[0, 0], [12, 0], [0, 14], [-9, -12]]),
            np.array([[1, 1], [3, 0.6], [0.6, 3], [2, 2]]),
        ),
        4,
    ),
    "ring": (around(np.linspace(0, 2 * math.pi, 60, endpoint=False), 20.0, 1.2), 1),
    "arc": (around(np.linspace(-1.2, 1.2, 40), 20.0, 1.0), 1),
    "far from the origin": (
        peaks([1, 1], np.array([[5000, -3000], [5012, -3000]]), np.array([1.0, 1.0])),
        2,
    ),
}


def drawn_from(mixture: Mixture) -> Floats:
    """Places (2, n) of the mixture itself, drawn without a cloud."""
    rng = np.random.default_rng(1)
    chosen = rng.choice(len(mixture.weights), DRAWN, p=mixture.weights / mixture.weights.sum())
    sds = np.sqrt(mixture.covariances[:, [0, 1], [0, 1]])
    return (mixture.means[chosen, :2] + sds[chosen] * rng.standard_normal((DRAWN, 2))).T


def held_by(outlines: tuple[Outline, ...], place: Floats) -> float:
    alike = np.full(place.shape[1], 1.0 / place.shape[1], np.float32)
    return sum(weight_within(place, alike, np.array(each)) for each in outlines)


def told(cloud: Cloud) -> tuple[Outline, ...]:
    return regions(cloud, moments(cloud))


@pytest.mark.parametrize("name", MIXTURES)
def test_outlines_hold_95_percent_of_what_the_cloud_was_drawn_from(name: str) -> None:
    mixture, many = MIXTURES[name]
    place = drawn_from(mixture)
    found = [told(spawn(mixture, 1000, step_key(1, seed))) for seed in range(SEEDS)]
    held = [held_by(each, place) for each in found]
    assert np.mean(held) == pytest.approx(SHARE, abs=0.015)
    assert min(held) > 0.91
    assert np.median([len(each) for each in found]) == many
    assert all(len(outline) <= CORNERS for each in found for outline in each)


@pytest.mark.parametrize("sds", [(1.0, 1.0), (4.0, 0.5)])
def test_one_peak_is_told_by_its_ellipse_and_the_ellipse_holds(sds: tuple[float, float]) -> None:
    mixture = peaks([1.0], np.array([[3.0, 4.0]]), np.array(sds))
    place, held = drawn_from(mixture), []
    for seed in range(SEEDS):
        cloud = spawn(mixture, 1000, step_key(2, seed))
        assert told(cloud) == ()
        summed = moments(cloud)
        nn, ne, ee = summed.covariance_m2
        u, v = place[0] - summed.north_m, place[1] - summed.east_m
        distance = (ee * u * u - 2 * ne * u * v + nn * v * v) / (nn * ee - ne * ne)
        held.append(float((distance < ELLIPSE_SCALE).mean()))
    assert np.mean(held) == pytest.approx(SHARE, abs=0.01)


def test_a_ring_is_told_with_its_hole() -> None:
    (outline,) = told(spawn(MIXTURES["ring"][0], 1000, Key(1, 2)))
    corners = np.array(outline)
    assert held_by((outline,), np.zeros((2, 1))) == 0.0
    assert 0.5 * abs(twice_area(corners)) < 0.6 * math.pi * 22.0**2


def test_no_more_outlines_than_a_message_takes() -> None:
    rng = np.random.default_rng(4)
    scattered = peaks([1.0] * 30, rng.uniform(-40, 40, (30, 2)), np.array([1.0, 1.0]))
    cloud = spawn(scattered, 1000, Key(1, 2))
    found = told(cloud)
    assert 0 < len(found) <= MOST_OUTLINES
    assert held_by(found, drawn_from(scattered)) > 0.93


def test_weights_count_not_particles() -> None:
    mixture = MIXTURES["two alike"][0]
    cloud, _ = tie(spawn(mixture, 1000, Key(1, 2)), [Tie(0.0, 0.0, (1.0, 0.0, 1.0), 2.0)])
    found = told(cloud)
    assert held_by(found, np.array([[20.0], [0.0]])) == 0.0


def test_a_cloud_in_one_place_is_no_outline() -> None:
    point = peaks([1.0], np.array([[3.0, 4.0]]), np.array([0.0, 0.0]))
    assert told(spawn(point, 64, Key(1, 2))) == ()


def test_the_same_cloud_has_the_same_outlines() -> None:
    mixture = MIXTURES["corridors"][0]
    assert told(spawn(mixture, 1000, Key(3, 4))) == told(spawn(mixture, 1000, Key(3, 4)))


def test_no_region_goes_off_the_map() -> None:
    edge_m = MOST_COORDINATE_M
    mixture = peaks([1, 1], np.array([[edge_m, 0], [edge_m - 30, 0]]), np.array([2.0, 2.0]))
    found = told(spawn(mixture, 1000, Key(1, 2)))
    assert max(north_m for ring in found for north_m, _ in ring) == edge_m
