"""What the team's smoother can be told, with the defaults it is tuned to."""

from __future__ import annotations

import math
from bisect import bisect_right
from typing import Annotated, TypeAlias

import msgspec
from msgspec import Meta

Metres: TypeAlias = Annotated[float, Meta(gt=0.0, le=1e4)]
Seconds: TypeAlias = Annotated[float, Meta(gt=0.0, le=1e4)]
Radians: TypeAlias = Annotated[float, Meta(gt=0.0, le=100.0)]


class Sharpness(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """How near somebody passed whose signal peaked so high: ``sd_m`` at ``peak_dbm``, ascending.

    Between two it is interpolated. Peaks below ``least_dbm`` say too little to be used, but of who
    has passed nothing nearer those down to ``faint_dbm`` are: a little is more than nothing.
    """

    peak_dbm: tuple[float, ...] = (-58.0, -54.0, -50.0, -46.0, -42.0, -38.0)
    sd_m: tuple[Metres, ...] = (5.5, 3.8, 2.9, 1.5, 0.8, 0.6)
    least_dbm: float = -48.0
    faint_dbm: float = -54.0
    dof: Annotated[float, Meta(ge=1.0, le=1000.0)] = 4.0

    def __post_init__(self) -> None:
        """Refuse a table that cannot be read."""
        if len(self.peak_dbm) != len(self.sd_m) or not self.peak_dbm:
            raise ValueError("sharpness: give as many sd_m as peak_dbm, one at least")
        if list(self.peak_dbm) != sorted(set(self.peak_dbm)):
            raise ValueError("sharpness.peak_dbm: put them in ascending order")

    def sd_at_m(self, peak_dbm: float) -> float:
        """Return the standard deviation of the place (m) for a peak of that power."""
        at = bisect_right(self.peak_dbm, peak_dbm)
        if at == 0:
            return self.sd_m[0]
        if at == len(self.peak_dbm):
            return self.sd_m[-1]
        share = (peak_dbm - self.peak_dbm[at - 1]) / (self.peak_dbm[at] - self.peak_dbm[at - 1])
        return self.sd_m[at - 1] + share * (self.sd_m[at] - self.sd_m[at - 1])


class TeamSettings(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The smoother's parameters.

    Every ``tick_s`` the whole team is solved; every ``commit_s`` the solution is kept as what the
    next ones start from, after other headings have been tried for each responder and adopted where
    the cost falls by more than ``adopt_gain``; where there are more than ``turned_a_commit``, by
    turns. Nodes are set every ``node_m`` or ``node_s``. A radio worn in front is loudest before its
    wearer is nearest, one worn behind after that: by ``lead_sd_s`` or so, and the whole team alike.
    All passes of a DAP whose place is known lie aside of it alike, by ``aside_share`` of how blunt
    they are.

    A team of more than ``crew_most`` is solved in crews of at most so many, each in its own time,
    and the more responders there are the more rarely, so that no more than ``solved_a_second`` are
    solved in a second; all of them at least once in ``commit_s``. Of such a crew the headings of
    ``turned_of_crowd`` are tried at a commit; and it is solved from where it was held to be
    between one and two times ``anchor_s`` ago. A smaller team is solved from where it was held to
    be ``horizon_s`` ago, or up to a quarter of that more. What comes ``lateness_s`` after it
    happened, or later, is not fused any more.

    A building's axis is believed in where there are ``axis_least_moves`` legs, and all is likelier
    with a share of ``axis_least_share`` of them along it, or more; that it is ``axis_rad``, where
    headings alone tell it to ``axis_seen_sd_rad``, unless somebody is alone at the incident. That
    it is a plan's, ``planned_axis_rad``, is believed in as well where headings come as near to it
    as ``planned_axis_most_off`` standard deviations. What units tell of how sure their turns are
    is taken ``told_turn_factor`` times as wide: of running boots, whose gyroscopes clip, it is far
    too narrow.

    How far passes and moves scatter is learnt, and held to what is told here by as many of
    them as ``noise_prior_passes`` and ``noise_prior_moves`` say: of one way alone hardly any move
    is told by anything else. A unit's scale is known to ``scale_sd``, which is more than boots
    differ by: strides that go unnoticed make all ways of a team short alike, and no pass tells.

    Straight moves are held to an axis as loosely as ``straight_sd_rad``, for it may be wrong; in
    covariances they are off it by ``straight_told_sd_rad``, and what is learnt of that.
    Covariances are told ``covariance_factor`` times as wide as they are solved; afterwards, of a
    team that is held to an axis given, ``given_axis_factor`` times that.
    """

    tick_s: Seconds = 2.0
    commit_s: Seconds = 10.0
    node_m: Metres = 6.0
    node_s: Seconds = 15.0
    tick_iterations: Annotated[int, Meta(ge=1, le=100)] = 5
    commit_iterations: Annotated[int, Meta(ge=1, le=100)] = 12
    settled_m: Metres = 0.01
    adopt_gain: Annotated[float, Meta(ge=0.0, le=1e3)] = 4.0
    turned_a_commit: Annotated[int, Meta(ge=1, le=10_000)] = 16
    turned_of_crowd: Annotated[int, Meta(ge=1, le=10_000)] = 4
    anchor_s: Seconds = 180.0
    horizon_s: Seconds = 2400.0
    lateness_s: Seconds = 3600.0
    crew_most: Annotated[int, Meta(ge=1, le=10_000)] = 16
    solved_a_second: Annotated[float, Meta(gt=0.0, le=1e6)] = 100.0

    scale_sd: Annotated[float, Meta(gt=0.0, le=1.0)] = 0.03
    loose_scale_sd: Annotated[float, Meta(gt=0.0, le=1.0)] = 0.12
    doubts: bool = True
    drift_sd_rad_s: Radians = math.radians(0.05)
    stride_sd_m: Metres = 0.03
    stride_sd_share: Annotated[float, Meta(ge=0.0, le=1.0)] = 0.025
    stride_turn_sd_rad: Radians = math.radians(0.6)
    told_turn_factor: Annotated[float, Meta(gt=0.0, le=100.0)] = 2.0
    lost_stride_m: Metres = 1.2
    unseen_share: Annotated[float, Meta(ge=0.0, le=1.0)] = 0.97
    unseen_turn_sd_rad: Radians = math.radians(6.0)
    start_sd_m: Metres = 0.5
    entrance_sd_m: Metres = 1.0
    unknown_start_sd_m: Metres = 30.0
    restart_sd_m: Metres = 1.0
    restart_speed_m_s: Metres = 1.0

    restart_climb_share: Annotated[float, Meta(ge=0.0, le=1.0)] = 0.3
    lost_climb_m: Metres = 0.2
    start_height_sd_m: Metres = 0.2
    passed_height_sd_m: Metres = 0.4

    install_sd_m: Metres = 0.3
    install_ahead_m: Annotated[float, Meta(ge=0.0, le=2.0)] = 0.25
    aside_share: Annotated[float, Meta(ge=0.0, le=10.0)] = 0.6
    sharpness: Sharpness = Sharpness()
    noise_prior_passes: Annotated[float, Meta(gt=0.0, le=1e6)] = 5.0
    noise_prior_moves: Annotated[float, Meta(gt=0.0, le=1e6)] = 15.0
    shadowing_m: Metres = 5.0
    lead_sd_s: Seconds = 0.2
    contact_gain_db: Annotated[float, Meta(ge=-50.0, le=50.0)] = 5.0
    contact_least_dbm: float = -54.0
    contact_sd_least_m: Metres = 0.6
    contact_share: Annotated[float, Meta(gt=0.0, le=2.0)] = 0.75
    contact_again_s: Seconds = 10.0

    axis: bool = True
    axis_rad: Annotated[float, Meta(ge=-math.pi, le=math.pi)] = 0.0
    axis_sd_rad: Radians = math.radians(0.5)
    straight_sd_rad: Radians = math.radians(6.0)
    straight_told_sd_rad: Radians = math.radians(3.0)
    straight_least_m: Metres = 1.8
    straight_share: Annotated[float, Meta(gt=0.5, le=1.0)] = 0.985
    axis_least_moves: Annotated[int, Meta(ge=1, le=1000)] = 2
    axis_least_share: Annotated[float, Meta(gt=0.0, le=1.0)] = 0.8
    axis_seen_sd_rad: Radians = math.radians(22.0)
    planned_axis_rad: Annotated[float, Meta(ge=-math.pi, le=math.pi)] | None = None
    planned_axis_most_off: Annotated[float, Meta(gt=0.0, le=100.0)] = 1.3
    axis_from_turn_sd_rad: Radians = math.radians(40.0)

    front_particles: Annotated[int, Meta(ge=64, le=100_000)] = 1024
    silence_s: Seconds = 20.0
    missed_beats: Annotated[float, Meta(ge=1.0, le=100.0)] = 3.0
    missed_s: Seconds = 3.0
    silent_speed_m_s: Metres = 0.5
    untied_s: Seconds = 90.0
    lost_sd_m: Metres = 8.0
    recovered_turn_sd_rad: Radians = math.radians(20.0)

    covariance_factor: Annotated[float, Meta(gt=0.0, le=100.0)] = 1.0
    given_axis_factor: Annotated[float, Meta(gt=0.0, le=100.0)] = 0.75
