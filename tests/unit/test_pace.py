"""A wearer's own step scale: found by a walk of known length, and what it does."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from edge_agent.__main__ import app
from edge_agent.evaluation.course_truth import Waypoints
from edge_agent.evaluation.pace import scale_over
from edge_agent.mounts.interface import Increment
from edge_agent.mounts.methods import MethodName, MountName, Told, make_mount
from shared.process import ExitCode
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


def test_the_first_metres_tell_the_scale_and_no_others() -> None:
    told = walk("chest", "robust", 1.0)
    ends_s = [one.end_time_ns / 1e9 for one in told]
    way_m = np.cumsum([one.displacement_m for one in told], axis=0)[:, :2]
    truth = Waypoints(
        np.array([0.0, *ends_s]),
        1.2 * np.vstack(([0.0, 0.0], way_m)) * np.linspace(1.0, 1.3, len(told) + 1)[:, None],
    )
    assert scale_over(told, truth, 0.1) == pytest.approx(1.2, rel=0.05)
    assert scale_over(told, truth, 8.0) > 1.3
    assert scale_over(told, truth, 1e3) == 1.0
