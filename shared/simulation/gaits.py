"""How a boot moves in each gait, as the shape of one stride from mid-stance to mid-stance.

Moments are shares of the stride's time. The shapes follow the pitch, speed and clearance that
motion capture shows of a foot: heel rise over the ball, swing, heel strike, roll to flat.
"""

from __future__ import annotations

import math
from typing import Generic, NamedTuple, TypeVar

from shared.messages import Activity
from shared.simulation.legs import Gait

Value = TypeVar("Value")

ACTIVITIES: dict[Gait, Activity] = {
    "stand": "stand",
    "walk": "walk",
    "fast_walk": "fast",
    "side_left": "side_step",
    "side_right": "side_step",
    "crawl": "crawl",
    "stairs_up": "stairs_up",
    "stairs_down": "stairs_down",
    "ladder": "ladder",
    "lift": "lift",
}
"""What a unit that knows for sure calls each gait."""


class StrideShape(NamedTuple, Generic[Value]):
    """One stride's shape; as a table, one value a stride.

    ``push_rad`` is how far the toe is down as the foot leaves the ground, ``reach_rad`` how far it
    is up before it lands (negative: it lands on the toe). The foot advances from ``go_start`` to
    ``go_end`` and meets the ground at ``touch``: ``carry`` is the share of the way it does at even
    speed until then, ``descent_m_s`` its speed downwards, ``arrest_s`` the time the ground takes to
    stop it. ``rise_*`` bounds the change of height on stairs. ``roll_rad``, ``yaw_rad`` and
    ``aside_m`` are how far the swinging foot tilts, turns and swings out; ``unrest`` scales the
    boot's small random motion, ``strike_m_s2`` its ringing as it lands; ``passing_rad_s`` is how
    fast it rolls towards the toe in a stance that is passed through.
    """

    push_rad: Value
    reach_rad: Value
    push_start: Value
    push_end: Value
    swing_start: Value
    swing_end: Value
    load_start: Value
    load_end: Value
    go_start: Value
    go_end: Value
    rise_start: Value
    rise_end: Value
    touch: Value
    carry: Value
    descent_m_s: Value
    arrest_s: Value
    lift_m: Value
    roll_rad: Value
    yaw_rad: Value
    aside_m: Value
    unrest: Value
    strike_m_s2: Value
    passing_rad_s: Value


CRAWL_POSTURE_RAD = math.radians(-80.0)
"""Pitch of a boot whose owner kneels with the toes on the ground."""

WALK = StrideShape(
    push_rad=math.radians(56.0),
    reach_rad=math.radians(38.0),
    push_start=0.02,
    push_end=0.365,
    swing_start=0.31,
    swing_end=0.7,
    load_start=0.665,
    load_end=0.92,
    go_start=0.285,
    go_end=0.725,
    rise_start=0.285,
    rise_end=0.725,
    touch=0.78,
    carry=0.15,
    descent_m_s=0.22,
    arrest_s=0.03,
    lift_m=0.01,
    roll_rad=math.radians(8.0),
    yaw_rad=math.radians(8.0),
    aside_m=0.02,
    unrest=1.0,
    strike_m_s2=10.0,
    passing_rad_s=math.radians(11.0),
)
FAST_WALK = WALK._replace(
    push_start=0.0,
    push_end=0.335,
    swing_start=0.275,
    swing_end=0.69,
    load_start=0.65,
    load_end=0.93,
    go_start=0.25,
    go_end=0.715,
    push_rad=math.radians(66.0),
    reach_rad=math.radians(42.0),
    descent_m_s=0.3,
    carry=0.15,
    arrest_s=0.025,
    roll_rad=math.radians(10.0),
    unrest=1.7,
    strike_m_s2=25.0,
    passing_rad_s=math.radians(22.0),
)
SIDE_STEP = WALK._replace(
    push_rad=math.radians(25.0),
    reach_rad=math.radians(6.0),
    carry=0.05,
    descent_m_s=0.2,
    lift_m=0.03,
    aside_m=0.0,
    strike_m_s2=6.0,
    passing_rad_s=math.radians(2.0),
)
CRAWL = WALK._replace(
    push_rad=math.radians(7.0),
    reach_rad=math.radians(5.0),
    push_start=0.18,
    push_end=0.42,
    swing_start=0.34,
    swing_end=0.66,
    load_start=0.60,
    load_end=0.84,
    go_start=0.27,
    go_end=0.73,
    touch=0.72,
    carry=0.5,
    descent_m_s=0.03,
    arrest_s=0.06,
    lift_m=0.005,
    roll_rad=math.radians(5.0),
    yaw_rad=math.radians(4.0),
    aside_m=0.01,
    unrest=2.8,
    strike_m_s2=4.0,
    passing_rad_s=math.radians(1.0),
)
STAIRS_UP = WALK._replace(
    passing_rad_s=math.radians(6.0),
    push_rad=math.radians(45.0),
    reach_rad=math.radians(6.0),
    rise_start=0.22,
    rise_end=0.62,
    descent_m_s=0.25,
    carry=0.05,
    lift_m=0.05,
    strike_m_s2=8.0,
)
STAIRS_DOWN = WALK._replace(
    passing_rad_s=math.radians(6.0),
    push_rad=math.radians(48.0),
    reach_rad=math.radians(-14.0),
    rise_start=0.36,
    rise_end=0.80,
    descent_m_s=0.35,
    carry=0.05,
    lift_m=0.04,
    strike_m_s2=12.0,
)

LADDER = STAIRS_UP._replace(
    passing_rad_s=math.radians(1.0),
    push_rad=math.radians(22.0),
    reach_rad=math.radians(8.0),
    rise_start=0.2,
    rise_end=0.7,
    descent_m_s=0.12,
    lift_m=0.03,
    roll_rad=math.radians(6.0),
    yaw_rad=math.radians(6.0),
    strike_m_s2=6.0,
)
LIFT = StrideShape(**dict.fromkeys(StrideShape._fields, 0.0))._replace(
    push_start=0.02, push_end=0.36, swing_start=0.3, swing_end=0.7, load_start=0.66, load_end=0.92,
    go_start=0.28, go_end=0.72, rise_start=0.0, rise_end=1.0, touch=0.43, arrest_s=0.03,
    unrest=0.1,
)  # fmt: skip
"""Nothing moves but the floor: the foot is down again as soon as it would be up."""

SHAPES: dict[Gait, StrideShape[float]] = {
    "walk": WALK,
    "fast_walk": FAST_WALK,
    "side_left": SIDE_STEP,
    "side_right": SIDE_STEP,
    "crawl": CRAWL,
    "stairs_up": STAIRS_UP,
    "stairs_down": STAIRS_DOWN,
    "ladder": LADDER,
    "lift": LIFT,
}
