"""Whose scale the team's fusion doubts: that of bodies that bounce, not of what was measured."""

from __future__ import annotations

from typing import get_args

from command_post.fusion.team.log import TeamLog
from shared.messages import Mount, TrackStart


def test_the_scale_of_boots_and_vehicles_is_not_doubted_as_that_of_bodies_is() -> None:
    log = TeamLog()
    for mount in get_args(Mount):
        start = TrackStart(
            event_time_ns=1, sequence=0, position=None, heading_sd_rad=0.1, mount=mount, method="m"
        )
        assert log.add_start(mount, start)
    doubted = {mount for mount in get_args(Mount) if log.of(mount).starts[0].is_loose}
    assert doubted == {"chest", "waist"}
