"""Who has left their team: only where the regions that hold them agree, and only after a while."""

from __future__ import annotations

from command_post.desks.alert_desk import AlertDesk
from command_post.fusion.track import Estimate
from command_post.nodes.teams import Left, Teams, TeamWatch
from shared.messages import TrackStatus
from shared.units import NS_PER_S

TEAMS = Teams(teams={"alpha": ("r1", "r2", "r3"), "bravo": ("r8", "r9")})


def at(
    time_s: float, north_m: float, sd_m: float = 1.0, status: TrackStatus = "tracking"
) -> Estimate:
    return Estimate(
        time_ns=round(time_s * NS_PER_S), north_m=north_m, east_m=0.0, down_m=0.0,
        covariance_m2=(sd_m**2, 0.0, 1.0), heading_rad=0.0, heading_sd_rad=1.0,
        last_proximity_time_ns=None, status=status,
    )  # fmt: skip


def walk(
    watch: TeamWatch, away_m: float, seconds: range, sd_m: float = 1.0, others: str = "tracking"
) -> list[tuple[int, Left]]:
    """Let r1 be ``away_m`` from r2 and r3, who stand together."""
    found = []
    for time_s in seconds:
        status: TrackStatus = "lost" if others == "lost" else "tracking"
        for name, estimate in (
            ("r2", at(time_s, 0.0, status=status)), ("r3", at(time_s, 2.0, status=status)),
            ("r1", at(time_s, away_m, sd_m)),
        ):  # fmt: skip
            found += [(time_s, left) for left in watch.take(name, estimate)]
    return found


def test_who_is_far_from_all_others_for_long_has_left_and_comes_back() -> None:
    watch = TeamWatch(TEAMS)
    assert walk(watch, 20.0, range(60)) == []
    ((when_s, left),) = walk(watch, 50.0, range(60, 120))
    assert when_s == 90
    assert left == ("r1", "48 m from r3, the nearest of team alpha")
    assert walk(watch, 27.0, range(120, 130)) == [], "between the limits nothing changes"
    assert [each for _, each in walk(watch, 20.0, range(130, 140))] == [Left("r1", None)]


def test_what_may_as_well_be_near_is_not_apart() -> None:
    assert walk(TeamWatch(TEAMS), 50.0, range(90), sd_m=10.0) == []


def test_those_who_are_lost_say_nothing_of_where_the_team_is() -> None:
    assert walk(TeamWatch(TEAMS), 50.0, range(90), others="lost") == []


def test_of_two_who_are_apart_one_is_alerted_to_and_who_is_of_no_team_never() -> None:
    watch, desk = TeamWatch(TEAMS), AlertDesk(0)
    found = []
    for time_s in range(60):
        for name, north_m in (("r8", 0.0), ("r9", 70.0), ("r7", 500.0)):
            found += watch.take(name, at(time_s, north_m))
    (alert,) = desk.leave(found, 5)
    assert (alert.kind, alert.node_id) == ("left_team", "r8")
    (over,) = desk.leave([Left("r8", None)], 6)
    assert over.stage == "resolved"
