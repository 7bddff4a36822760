"""A wearer's own step scale: found by a walk of known length, and what it does."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from edge_agent.__main__ import app
from edge_agent.evaluation.course_truth import Waypoints
from edge_agent.evaluation.pace import AFTER_STEPS, BEFORE_STEPS, scale_over, steady_length_m
from edge_agent.mounts.interface import Increment
from edge_agent.mounts.methods import MethodName, MountName, Told, make_mount
from shared.process import ExitCode
from shared.units import NS_PER_S
from tests.bouncing_phone import Phone


def walk(mount: MountName, method: MethodName, scale: float) -> list[Increment]:
    follower = make_mount(mount, method, Told(step_scale=scale))
    told = [follower.step(one) for one in Phone(steps=20, turn_rad_s=0.05).samples()]
    return [one for one in told if one is not None] + follower.finish()


@pytest.mark.parametrize("mount", ["chest", "waist"])
@pytest.mark.parametrize("method", ["robust", "published"])
def test_steps_are_as_long_as_the_scale_says(mount: MountName, method: MethodName) -> None:
    usual, long = walk(mount, method, 1.0), walk(mount, method, 1.25)
    assert len(usual) == len(long) >= 10
    for one, other in zip(usual, long, strict=True):
        assert math.hypot(*other.displacement_m) == pytest.approx(
            1.25 * math.hypot(*one.displacement_m)
        )


def test_only_who_steps_has_a_step_scale() -> None:
    with pytest.raises(ValueError, match="--step-scale: only of a chest or a waist"):
        make_mount("boot", "eskf", Told(step_scale=1.1))


def test_a_walk_of_known_length_tells_the_scale(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    samples = list(Phone(steps=30).samples())
    np.savez(
        tmp_path / "walk.npz",
        t_s=[one.time_ns / 1e9 for one in samples],
        acc_m_s2=[one.force_m_s2 for one in samples],
        gyr_rad_s=[one.rate_rad_s for one in samples],
    )
    arguments = ["pace", f"npz:{tmp_path / 'walk.npz'}", "--walked"]
    scales = []
    for walked in ("20", "30"):
        code = app([*arguments, walked], exit_on_error=False, result_action="return_value")
        assert code == ExitCode.OK
        scales.append(float(capsys.readouterr().out.split()[-1]))
    assert scales[1] == pytest.approx(1.5 * scales[0], abs=0.002)
    wrong = ["pace", f"npz:{tmp_path / 'none.npz'}", "--walked", "20"]
    assert app(wrong, exit_on_error=False, result_action="return_value") == ExitCode.USAGE


def steps(lengths_m: list[float], lasting_s: float = 0.5) -> list[Increment]:
    """Return steps straight north, of these lengths and all as quick, one after another."""
    return [
        Increment(
            round(k * lasting_s * NS_PER_S),
            round((k + 1) * lasting_s * NS_PER_S),
            (length_m, 0.0, 0.0),
            0.0,
            0.0,
            (0.0,) * 10,
            (),
        )
        for k, length_m in enumerate(lengths_m)
    ]


def test_soft_steps_at_either_end_count_as_the_steady_ones_do() -> None:
    walked = steps([0.2, 0.45, 0.55, *[0.6] * 20, 0.5, 0.1])
    whole = BEFORE_STEPS["waist"] + 23 + AFTER_STEPS["waist"]
    assert steady_length_m(walked, "waist", arrives=True) == pytest.approx(0.6 * whole)
    midway = steady_length_m(walked[:-2], "waist", arrives=False)
    assert midway == pytest.approx(0.6 * (BEFORE_STEPS["waist"] + 22))
    assert steady_length_m([], "waist", arrives=True) == 0.0


def test_the_first_metres_tell_the_scale_and_no_others() -> None:
    walked = steps([0.6] * 40)
    ends_s = np.array([one.end_time_ns / NS_PER_S for one in walked])
    ahead_m = 0.6 * (BEFORE_STEPS["waist"] + np.arange(1, 41))
    true_m = 1.2 * np.minimum(ahead_m, 12.0) + 1.5 * np.maximum(ahead_m - 12.0, 0.0)
    truth = Waypoints(
        np.append(0.0, ends_s), np.column_stack((np.append(0.0, true_m), np.zeros(41)))
    )
    assert scale_over(walked, truth, 8.0, "waist") == pytest.approx(1.2)
    assert scale_over(walked, truth, 25.0, "waist") > 1.25
    assert scale_over(walked, truth, 1e3, "waist") == 1.0
