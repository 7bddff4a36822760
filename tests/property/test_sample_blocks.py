"""Samples in blocks are the samples one by one, to the bit, whatever is amiss with them."""

from __future__ import annotations

import copy
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from edge_agent.inertial.boot_tracker import BootTracker
from edge_agent.mounts.methods import MethodName, make_mount
from edge_agent.sources.recording import Recording
from shared.units import NS_PER_S
from tests.recorded import recorded
from tests.synthetic_boot import SyntheticWalk

FIELD_UT = (22.0, 0.0, 41.0)
WALK = recorded(SyntheticWalk(strides=5, turn_rad=0.2, field_ut=FIELD_UT), 100.0)


@st.composite
def amiss(draw: st.DrawFn) -> Recording:
    """A walk with samples lost, late, repeated and unreadable, and a clock that is set."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    n = len(WALK)
    places = np.arange(n) + draw(st.sampled_from([0.0, 2.0, 9.0])) * rng.random(n) ** 20
    rows = np.argsort(places, kind="stable")
    rows = np.repeat(rows, rng.choice([0, 1, 2], n, p=draw(st.sampled_from(KEPT))))
    if draw(st.booleans()):
        gap, length = draw(st.integers(0, n)), draw(st.sampled_from([3, 20, 100]))
        rows = rows[(rows < gap) | (rows >= gap + length)]
    walk = WALK.rows(rows)
    if draw(st.booleans()):
        walk = replace(walk, field_ut=None)
    if draw(st.booleans()):
        pressure_pa = 1e5 + np.cumsum(rng.normal(0.0, 3.0, len(rows)))
        pressure_pa[rng.random(len(rows)) < 0.9] = np.nan
        walk = replace(walk, pressure_pa=pressure_pa)
    later_ns = draw(st.sampled_from([0, -NS_PER_S, 7 * NS_PER_S]))
    time_ns = walk.time_ns + later_ns * (np.arange(len(rows)) > draw(st.integers(0, n)))
    force_m_s2 = walk.force_m_s2.copy()
    force_m_s2[rng.random(len(rows)) < draw(st.sampled_from([0.0, 0.01, 0.2]))] = np.nan
    return replace(walk, time_ns=time_ns, force_m_s2=force_m_s2)


KEPT = [[0.0, 1.0, 0.0], [0.05, 0.9, 0.05], [0.3, 0.7, 0.0]]
"""Shares of samples lost, sent once, and sent twice."""


@settings(max_examples=60)
@given(amiss())
def test_a_tracker_is_left_as_by_single_samples(recording: Recording) -> None:
    single, rows = BootTracker(), BootTracker()
    strides = [stride for sample in recording for stride in single.step(sample)]
    found, row = [], 0
    while row < len(recording):
        row, closed = rows.step_rows(recording, row)
        found += closed
    assert found == strides
    assert rows.save() == single.save()
    assert rows.finish() == single.finish()


@pytest.mark.parametrize("method", ["eskf", "linear"])
@settings(max_examples=30)
@given(amiss(), st.lists(st.integers(0, len(WALK)), max_size=3))
def test_a_mount_tells_the_same_and_goes_on_alike(
    method: MethodName, recording: Recording, cuts: list[int]
) -> None:
    single, blocks = make_mount("boot", method), make_mount("boot", method)
    edges = [0, *sorted(cuts), len(recording)]
    for first, after in pairwise(edges):
        block = recording.rows(slice(first, after))
        one_by_one = [i for sample in block for i in [single.step(sample)] if i is not None]
        assert blocks.steps(block) == one_by_one
        assert copy.deepcopy(blocks).finish() == copy.deepcopy(single).finish()
        assert (blocks.faults, blocks.heading_rad) == (single.faults, single.heading_rad)
    assert blocks.finish() == single.finish()


@pytest.mark.parametrize("rate_hz", [50.0, 397.7, 1000.0])
def test_blocks_find_the_strides_at_any_rate(rate_hz: float) -> None:
    recording = recorded(SyntheticWalk(strides=3), rate_hz)
    single, blocks = make_mount("boot", "eskf"), make_mount("boot", "eskf")
    told = blocks.steps(recording)
    assert len(told) == 3
    assert told == [i for sample in recording for i in [single.step(sample)] if i is not None]
