"""What the kernels mean, in plain numpy and double precision: slow, and for tests to compare with.

A plain cloud is an array (6, n), rows north and east (m of the cloud's origin), heading offset φ,
its drift, log-scale and weight. Steps, ties and mixtures are the kernels' own rows.
"""

from __future__ import annotations

import math
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from command_post.fusion.cloud.chance import Key
from command_post.fusion.cloud.layout import (
    BLOCK,
    COMPONENT_MEAN,
    COMPONENT_ROOT,
    COMPONENT_TURNED,
    COMPONENT_WEIGHT,
    DRIFT_WALK,
    FIELDS,
    JUMP_BELOW,
    LANES,
    MISSED_FROM,
    MOST_AT_ONCE,
    MOVE_EAST,
    MOVE_NORTH,
    MOVE_S,
    ROOT_EE,
    ROOT_EN,
    ROOT_HE,
    ROOT_HH,
    ROOT_HN,
    ROOT_JUMP,
    ROOT_NN,
    SINCE_EAST,
    SINCE_NORTH,
    TIE_AREA,
    TIE_EAST,
    TIE_EE,
    TIE_EXPONENT,
    TIE_NE,
    TIE_NN,
    TIE_NORTH,
    Lanes,
)
from command_post.fusion.cloud.noise import CHANCE, NORMAL, PLACES

Floats: TypeAlias = NDArray[np.float64]
Words: TypeAlias = NDArray[np.uint32]

NORTH, EAST, OFFSET, DRIFT, LOG_SCALE, WEIGHT = range(6)

LEAST = math.exp(-40.0)
"""A lower weight is raised to it, and so is what a few ties leave of one."""


class PlainMoments(NamedTuple):
    """Mean place, covariance (nn, ne, ee), circular mean and deviation of φ, 1 / Σw²."""

    place_m: tuple[float, float]
    covariance_m2: tuple[float, float, float]
    offset_rad: float
    offset_sd_rad: float
    effective_count: float


def plain_cloud(lanes: Lanes) -> Floats:
    """Return a cloud's six states, one row each."""
    fields = lanes.reshape(-1, FIELDS, LANES)[:, :6]
    return fields.transpose(1, 0, 2).reshape(6, lanes.size // BLOCK * LANES).astype(np.float64)


def words_of(counters: Words, key: Key) -> Words:
    """Return the random words of ``counters`` under a key."""
    fifteen, sixteen = np.uint32(15), np.uint32(16)
    x = counters + np.uint32(key.low)
    x = (x ^ (x >> sixteen)) * np.uint32(0x21F0AAAD) ^ np.uint32(key.high)
    x = (x ^ (x >> fifteen)) * np.uint32(0xD35A2D97)
    return x ^ (x >> fifteen)


def normal_of(words: Words) -> Floats:
    """Return the standard normal numbers of random words: the sum of their bytes, with tails."""
    x: Floats = words.view(np.uint8).reshape(-1, 4).sum(axis=1) - 510.0
    return 6.42104061e-3 * x + 5.77395428e-9 * x**3


def spawn_plain(count: int, components: Lanes, key: Key) -> Floats:
    """Draw from a mixture, each component its share give or take one particle."""
    numbers = np.arange(count, dtype=np.uint32)
    first = (words_of(np.array([0xFFFFFFFF], np.uint32), key)[0] >> 8) / 2**24
    marks = (numbers + first) / count
    bounds = components[:, COMPONENT_WEIGHT]
    chosen = np.minimum(np.searchsorted(bounds, marks, side="right"), len(components) - 1)
    normal = np.stack([normal_of(words_of(8 * numbers + np.uint32(j), key)) for j in range(5)])
    roots = np.zeros((len(components), 5, 5))
    roots[:, *np.tril_indices(5)] = components[:, COMPONENT_ROOT : COMPONENT_ROOT + 15]
    means = components[:, COMPONENT_MEAN : COMPONENT_MEAN + 5].astype(np.float64)
    state = means[chosen].T + np.einsum("nij,jn->in", roots[chosen], normal)
    anywhere = (words_of(8 * numbers + np.uint32(5), key) >> 8) / 2**24 * 2.0 * math.pi - math.pi
    offset = np.where(components[chosen, COMPONENT_TURNED] > 0.0, anywhere, _wrap(state[2]))
    weight = np.full(count, 1.0 / count)
    return np.stack([state[0], state[1], offset, state[4], state[3], weight])


def noise_plain(numbers: Lanes, words: Words, shift: int) -> Floats:
    """Return the run of LANES in a table that each block's word tells, one after another."""
    places = words >> np.uint32(shift) & np.uint32(PLACES - 1)
    read: Floats = numbers[places[:, None] + np.arange(LANES)].ravel().astype(np.float64)
    return read


def move_plain(cloud: Floats, step: Lanes, key: Key) -> Floats:
    """Move every particle by its own reading of a step."""
    counters = 3 * np.arange(cloud.shape[1] // LANES, dtype=np.uint32)
    words = [words_of(counters + np.uint32(k), key) for k in range(3)]
    to_north, to_east = (noise_plain(NORMAL, words[0], shift) for shift in (0, 13))
    to_heading, to_drift = (noise_plain(NORMAL, words[1], shift) for shift in (0, 13))
    happening = noise_plain(CHANCE, words[2], 0)
    strides = np.where(happening >= step[MISSED_FROM], 2.0, 1.0)
    own = np.where(happening < step[JUMP_BELOW], step[ROOT_JUMP], step[ROOT_HH])
    north = strides * step[MOVE_NORTH] + step[ROOT_NN] * to_north
    east = strides * step[MOVE_EAST] + step[ROOT_EN] * to_north + step[ROOT_EE] * to_east
    turned = step[ROOT_HN] * to_north + step[ROOT_HE] * to_east + own * to_heading
    moved = cloud.copy()
    moved[:2] += _led(cloud, north, east)
    moved[DRIFT] += step[DRIFT_WALK] * to_drift
    moved[OFFSET] = _wrap(cloud[OFFSET] + moved[DRIFT] * step[MOVE_S] + turned)
    return moved


def tie_plain(cloud: Floats, ties: Lanes) -> tuple[Floats, float]:
    """Weigh by Student's t about each place; return the cloud and the log-evidence."""
    weight, evidence = cloud[WEIGHT], 0.0
    for group in _alike(ties.astype(np.float64)):
        product = np.ones_like(weight)
        for tie in group:
            since = _led(cloud, tie[SINCE_NORTH], tie[SINCE_EAST])
            u, v = cloud[:2] - since - tie[[TIE_NORTH, TIE_EAST], None]
            product *= 1.0 + tie[TIE_NN] * u * u + tie[TIE_NE] * u * v + tie[TIE_EE] * v * v
            evidence -= math.log(tie[TIE_AREA])
        exponent = group[0, TIE_EXPONENT]
        likelihood = np.maximum((product / product.min()) ** exponent, LEAST)
        weight = np.maximum(weight * likelihood, LEAST)
        evidence += exponent * math.log(product.min())
    whole = float(weight.sum())
    return np.vstack([cloud[:WEIGHT], weight / whole]), evidence + math.log(whole)


def source_plain(cloud: Floats, key: Key) -> NDArray[np.intp]:
    """Return which particle each is a copy of, drawn systematically (Kitagawa 1996, appendix).

    Who is drawn stays; copies of who is drawn more often take the others' places in turn.
    """
    word = words_of(np.array([0xFFFFFFFF], np.uint32), Key(key.low ^ 0x9E3779B9, key.high))[0]
    shares: Floats = np.floor(cloud[WEIGHT] * 2.0**30)
    count = shares.size
    spacing = float(shares.sum()) // count
    marks = float(word) * spacing // 2**32 + spacing * np.arange(count)
    drawn = np.searchsorted(np.add.accumulate(shares), marks, side="left")
    copies = np.bincount(drawn, minlength=count)
    source = np.arange(count)
    source[copies == 0] = np.repeat(source, np.maximum(copies - 1, 0))
    return source


def loosen_plain(drawn: Floats, kept: float, key: Key) -> Floats:
    """Weigh all alike, and scatter drift and log-scale about their mean, whose variance stays."""
    loosened = drawn.copy()
    count = drawn.shape[1]
    blocks = np.arange(count // LANES, dtype=np.uint32)
    words = words_of(blocks, Key(key.low ^ 0x9E3779B9, key.high))
    for row, shift in ((DRIFT, 0), (LOG_SCALE, 13)):
        normal = noise_plain(NORMAL, words, shift)
        mean, sd = drawn[row].mean(), drawn[row].std()
        scattered = kept * drawn[row] + (1.0 - kept) * mean
        loosened[row] = scattered + math.sqrt(1.0 - kept * kept) * sd * normal
    loosened[WEIGHT] = 1.0 / count
    return loosened


def moments_plain(cloud: Floats) -> PlainMoments:
    """Sum a cloud up; its weights sum to one."""
    weights = cloud[WEIGHT]
    north, east = cloud[:2] @ weights
    u, v = cloud[NORTH] - north, cloud[EAST] - east
    direction = complex((weights * np.exp(1j * cloud[OFFSET])).sum())
    return PlainMoments(
        place_m=(float(north), float(east)),
        covariance_m2=(
            float(weights @ (u * u)),
            float(weights @ (u * v)),
            float(weights @ (v * v)),
        ),
        offset_rad=math.atan2(direction.imag, direction.real),
        offset_sd_rad=math.sqrt(-2.0 * math.log(min(abs(direction), 1.0))),
        effective_count=float(1.0 / (weights @ weights)),
    )


def _alike(ties: Floats) -> list[Floats]:
    """Return runs of ties of one exponent, five at most, from the last to the first."""
    breaks = [len(ties)]
    for i in range(len(ties) - 1, 0, -1):
        if ties[i, TIE_EXPONENT] != ties[i - 1, TIE_EXPONENT] or breaks[-1] - i == MOST_AT_ONCE:
            breaks.append(i)
    return np.split(ties, breaks[:0:-1])[::-1] if len(ties) else []


def _led(cloud: Floats, north: Floats | float, east: Floats | float) -> Floats:
    """Return (2, n): where a displacement in the agent's frame leads each particle."""
    scale = np.exp(cloud[LOG_SCALE])
    cosine, sine = scale * np.cos(cloud[OFFSET]), scale * np.sin(cloud[OFFSET])
    return np.stack([cosine * north - sine * east, sine * north + cosine * east])


def _wrap(angle_rad: Floats) -> Floats:
    return np.remainder(angle_rad + math.pi, 2.0 * math.pi) - math.pi
