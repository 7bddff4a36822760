"""What somebody does in an exercise: the legs of their route, and how they make each gait."""

from __future__ import annotations

from typing import Annotated, Literal, TypeAlias

import msgspec
from msgspec import Meta

from shared.messages import NodeId
from shared.simulation.plan import Point

Gait: TypeAlias = Literal[
    "stand", "walk", "fast_walk", "side_left", "side_right", "crawl", "stairs_up", "stairs_down",
    "ladder", "lift",
]  # fmt: skip
LevelGait: TypeAlias = Literal["walk", "fast_walk", "side_left", "side_right", "crawl"]
Seconds: TypeAlias = Annotated[float, Meta(ge=0.0, le=1e5)]
Share: TypeAlias = Annotated[float, Meta(ge=0.0, le=1.0)]
Count: TypeAlias = Annotated[int, Meta(ge=1, le=100)]


class Stand(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag_field="do", tag="stand"):
    """Stand still for ``for_s``, and if told so set down the DAP ``installs`` meanwhile.

    With ``until_s``, a time of the exercise, one stands on until then.
    """

    for_s: Seconds
    installs: NodeId | None = None
    until_s: Seconds = 0.0


class Move(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag_field="do", tag="move"):
    """Go on level ground through each point of ``to_m`` to the last, in one gait.

    If ``exact``, as through a door, chance moves none of them.
    """

    gait: LevelGait
    to_m: Annotated[tuple[Point, ...], Meta(min_length=1)]
    exact: bool = False


class Climb(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag_field="do", tag="climb"):
    """Take the flight ``stairs`` from the end one stands at to the other."""

    stairs: str


class Ride(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag_field="do", tag="ride"):
    """Stand in a lift, where one is, that goes to the floor ``to_floor``."""

    to_floor: str
    speed_m_s: Annotated[float, Meta(gt=0.1, le=10.0)] = 1.6
    acceleration_m_s2: Annotated[float, Meta(gt=0.1, le=3.0)] = 1.0


class Go(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag_field="do", tag="go"):
    """Go by the plan's ways, and its stairs, to near ``to_m`` of a floor, and then straight there.

    Without ``floor`` it is the one that one is on.
    """

    to_m: Point
    floor: str | None = None
    gait: LevelGait = "walk"


class Search(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag_field="do", tag="search"):
    """Search rooms drawn by chance, as many as ``rooms`` bounds, on ``floors`` (all, if none).

    Between them one goes by the plan's ways in ``way_gait``. In each one follows the walls, or
    wanders through as many points as ``points`` bounds, in ``gait``, and stands at the door within
    the bounds of ``stand_s``. After a share of ``detours`` of them one first goes to a turn of the
    ways drawn by chance; with the probability ``returns`` one goes back at last to where one began.
    """

    rooms: tuple[Count, Count] = (4, 6)
    floors: tuple[str, ...] = ()
    gait: LevelGait = "walk"
    way_gait: LevelGait = "walk"
    pattern: Literal["wall", "wander"] = "wall"
    points: tuple[Count, Count] = (4, 8)
    stand_s: tuple[Seconds, Seconds] = (0.0, 6.0)
    detours: Share = 0.35
    returns: Share = 0.5

    def __post_init__(self) -> None:
        """Refuse bounds the wrong way round."""
        for name in ("rooms", "points", "stand_s"):
            low, high = getattr(self, name)
            if low > high:
                raise ValueError(f"{name}: {low} is more than {high}; give the lesser first")


PlainLeg: TypeAlias = Stand | Move | Climb | Ride
Leg: TypeAlias = Stand | Move | Climb | Ride | Go | Search


class Habit(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """How a person makes one gait: length of a stride and the time it takes, on average.

    A stride is from one stance of a foot to the next of the same foot. On stairs the steps give
    the length.
    """

    stride_m: Annotated[float, Meta(gt=0.1, le=4.0)]
    stride_s: Annotated[float, Meta(gt=0.3, le=10.0)]


LADDER = Habit(0.6, 1.9)


class Person(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """How somebody moves. ``spread`` is the standard deviation of a stride, as a share of it."""

    walk: Habit = Habit(1.2, 1.12)
    fast_walk: Habit = Habit(1.8, 0.95)
    side_left: Habit = Habit(0.6, 1.3)
    side_right: Habit = Habit(0.6, 1.3)
    crawl: Habit = Habit(0.6, 1.5)
    stairs_up: Habit = Habit(0.67, 1.3)
    stairs_down: Habit = Habit(0.67, 1.2)
    spread: Share = 0.03

    def habit(self, gait: Gait) -> Habit:
        """How they make ``gait``, which is not standing; a ladder is climbed by all alike."""
        if gait == "ladder":
            return LADDER
        habit: Habit = getattr(self, gait)
        return habit
