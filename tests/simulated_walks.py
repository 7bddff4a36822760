"""Small scenarios of one responder, for tests of the simulator."""

from __future__ import annotations

from shared.simulation.imu_errors import ImuSettings
from shared.simulation.legs import Climb, Gait, Leg, LevelGait, Move, Ride, Stand
from shared.simulation.plan import Point
from shared.simulation.scenario import Responder, Scenario

LEVEL_GAITS: tuple[LevelGait, ...] = ("walk", "fast_walk", "side_left", "side_right", "crawl")
ALL_GAITS: tuple[Gait, ...] = (*LEVEL_GAITS, "stairs_up", "stairs_down", "ladder", "lift")


def lone_walk(
    *legs: Leg,
    start_m: Point = (0.0, 0.0),
    heading_deg: float = 0.0,
    imu: ImuSettings | None = None,
    jitter_m: float = 0.0,
    floor: str = "ground",
) -> Scenario:
    """Return a scenario in which ``r1`` stands, takes ``legs`` and stands again."""
    responder = Responder(
        start_m=start_m,
        heading_deg=heading_deg,
        route=(Stand(3.0), *legs, Stand(3.0)),
        route_jitter_m=jitter_m,
        floor=floor,
    )
    return Scenario(
        description="one responder",
        plan="course_building" if floor == "ground" else "tower",
        responders={"r1": responder},
        imu=imu or ImuSettings(),
    )


def gait_walk(gait: Gait, length_m: float, imu: ImuSettings | None = None) -> Scenario:
    """Return a scenario in which ``r1`` goes ``length_m`` in one gait; stairs have a given one."""
    if gait == "stairs_up":
        return lone_walk(Climb("up"), start_m=(15.2, 21.0), heading_deg=-90.0, imu=imu)
    if gait == "stairs_down":
        return lone_walk(Climb("down"), start_m=(12.0, 22.8), heading_deg=90.0, imu=imu)
    if gait == "ladder":
        return lone_walk(Climb("ladder"), start_m=(12.0, -4.0), floor="fifth", imu=imu)
    if gait == "lift":
        return lone_walk(Ride("second"), Ride("third"), floor="first", imu=imu)
    level: LevelGait = gait if gait != "stand" else "walk"
    facing_deg = {"side_left": 90.0, "side_right": -90.0}.get(gait, 0.0)
    return lone_walk(Move(level, ((length_m, 0.0),)), heading_deg=facing_deg, imu=imu)
