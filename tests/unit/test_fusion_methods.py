"""Getting a way of fusing ready leaves nothing to be built."""

from __future__ import annotations

from typing import Any, get_args

import pytest
from msgspec import structs

from command_post.fusion.cloud import kernels
from command_post.fusion.methods import make_fusion, prepare_fusion
from command_post.fusion.settings import FusionMethod, FusionSettings
from command_post.fusion.team import axis, smoother
from command_post.fusion.team.settings import TeamSettings
from shared.config import ConfigError, checked


@pytest.mark.parametrize("method", get_args(FusionMethod))
def test_every_method_is_made_and_rehearsed(method: FusionMethod) -> None:
    settings = FusionSettings(method=method)
    prepare_fusion(settings)
    assert not make_fusion(settings).estimates


def test_the_team_is_ready_with_its_smoother_its_axis_and_its_cloud() -> None:
    prepare_fusion(FusionSettings(method="team"))
    needed: tuple[Any, ...] = (
        kernels.run_steps, kernels.spawn_particles, smoother.smooth,
        axis.first_of_corridor, axis.cost_of_legs,
    )  # fmt: skip
    assert all(kernel.signatures for kernel in needed)


def test_a_passage_that_would_be_known_exactly_is_refused() -> None:
    sharpness = structs.replace(TeamSettings().sharpness, peak_dbm=(-50.0,), sd_m=(0.0,))
    with pytest.raises(ConfigError, match=r"sd_m\[0\]: Expected `float` > 0.0"):
        checked(FusionSettings(team=TeamSettings(sharpness=sharpness)))
