"""The ways of fusing, by name, and getting one ready."""

from __future__ import annotations

import math

from command_post.fusion.cloud.preparation import prepare as prepare_cloud
from command_post.fusion.interface import Fusion
from command_post.fusion.settings import FusionSettings
from command_post.fusion.team.team_tracker import TeamTracker
from command_post.fusion.tracker import Tracker
from shared.messages import (
    Contact,
    DapInstallation,
    LocalPosition,
    OdometryIncrement,
    PositionFix,
    RssiPeak,
    TrackStart,
)
from shared.units import NS_PER_S

_AT_ORIGIN = LocalPosition(north_m=0.0, east_m=0.0, down_m=0.0, covariance_m2=(1.0, 0.0, 1.0))
_PEAK_DBM = -42.0
_KNOWN_SD_RAD = math.radians(2.0)
_REHEARSED_STRIDES = 40
_SIDE_STRIDES = 10
_PEAK_AT = 20


def make_fusion(settings: FusionSettings) -> Fusion:
    """Return a new tracker of everybody, fusing as the settings say."""
    return TeamTracker(settings.team) if settings.method == "team" else Tracker(settings)


def prepare_fusion(settings: FusionSettings) -> None:
    """Have all machine code built that fusing so needs, by rehearsing an incident of two.

    One knows their heading and shows the building's axis, the other one does not. Takes some tens
    of seconds after an installation, and about one from then on.
    """
    fusion = make_fusion(settings)
    for responder_id, heading_sd_rad in (("a", _KNOWN_SD_RAD), ("b", math.pi)):
        start = TrackStart(
            event_time_ns=0, sequence=0, position=_AT_ORIGIN, heading_sd_rad=heading_sd_rad,
            mount="boot", method="rehearsal",
        )  # fmt: skip
        fusion.start(responder_id, start)
    installation = DapInstallation(
        event_time_ns=0, sequence=0, installer_id=None, position=_AT_ORIGIN
    )
    fusion.install("dap", installation)
    for number in range(1, _REHEARSED_STRIDES + 1):
        for responder_id in ("a", "b"):
            fusion.move(responder_id, _stride(number))
        if number == _PEAK_AT:
            _meet(fusion, number * NS_PER_S)
    fusion.take_changes()
    fusion.afterwards()
    if settings.method == "team":
        prepare_cloud()


def _stride(number: int) -> OdometryIncrement:
    """Return one of a lap of a square."""
    heading_rad = 0.5 * math.pi * (number // _SIDE_STRIDES)
    return OdometryIncrement(
        event_time_ns=number * NS_PER_S, start_time_ns=(number - 1) * NS_PER_S, sequence=number,
        d_north_m=math.cos(heading_rad), d_east_m=math.sin(heading_rad), d_down_m=0.0,
        d_heading_rad=0.0, heading_rad=heading_rad, mount="boot",
        covariance=(0.01, 0.0, 0.0, 0.0, 0.01, 0.0, 0.0, 0.01, 0.0, 0.001),
    )  # fmt: skip


def _meet(fusion: Fusion, time_ns: int) -> None:
    """Have the two pass the DAP and each other, and somebody say where one is."""
    for responder_id in ("a", "b"):
        passed = RssiPeak(
            event_time_ns=time_ns, sequence=0, responder_id=responder_id, peak_dbm=_PEAK_DBM,
            width_s=1.0, sample_count=5,
        )  # fmt: skip
        fusion.peak("dap", passed)
    met = Contact(
        event_time_ns=time_ns, sequence=0, other_id="b", peak_dbm=_PEAK_DBM, width_s=1.0,
        sample_count=5,
    )  # fmt: skip
    fusion.contact("a", met)
    fix = PositionFix(
        event_time_ns=time_ns, sequence=0, responder_id="a", source="commander",
        position=_AT_ORIGIN,
    )  # fmt: skip
    fusion.fix(fix)
