"""The board: the newest of everything for whoever asks, however seldom; who is silent spreads."""

from __future__ import annotations

import math

import pytest

from command_post.confidence import CHI_SQUARE_95
from command_post.desks.alert_desk import MOST_ALERTS
from command_post.roster import ResponderRow, Roster
from command_post.web.board import MOST_OUTSIDE, SILENCE_S, SILENT_SPEED_M_S, TRAIL_POINTS, Board
from shared.codec import encode
from shared.messages import Alert, FloorShare, LocalPosition, OutsideWord, TrackEstimate
from shared.units import NS_PER_S

KEY = "clew/v1/test/post/post/track"


def track(at_s: float, north_m: float, responder_id: str = "r1", down_m: float = 0.0) -> bytes:
    return encode(
        TrackEstimate(
            event_time_ns=round(at_s * NS_PER_S), sequence=0, responder_id=responder_id,
            north_m=north_m, east_m=0.0, down_m=down_m, covariance_m2=(4.0, 0.0, 1.0),
            heading_rad=0.1, heading_sd_rad=0.1, last_proximity_time_ns=None,
            floors=(FloorShare(down_m, 0.9),),
        )
    )  # fmt: skip


def show(board: Board, now_s: float, *rows: ResponderRow) -> None:
    roster = Roster(round(now_s * NS_PER_S), rows, ())
    board.show(roster)


def silent(for_s: float) -> ResponderRow:
    return ResponderRow(
        "r1", "lost", f"nothing heard for {for_s:.0f} s", None, None, for_s, None, None, None, None
    )


def test_whoever_asks_is_told_what_has_changed_since() -> None:
    board = Board()
    board.publish(KEY, track(1.0, 0.0))
    board.publish(KEY, track(1.0, 5.0, "r2"))
    first = board.since(0)
    assert {view.responder_id for view in first.tracks} == {"r1", "r2"}
    assert first.trails == {"r1": [(0.0, 0.0, 0.0)], "r2": [(5.0, 0.0, 0.0)]}
    board.publish(KEY, track(2.0, 1.0))
    board.publish(KEY, track(3.0, 2.0))
    then = board.since(first.version)
    assert [(view.responder_id, view.north_m) for view in then.tracks] == [("r1", 2.0)]
    assert then.trails is None
    assert board.since(then.version).tracks == []


def test_the_ellipse_lies_as_the_covariance_does() -> None:
    board = Board()
    board.publish(KEY, track(1.0, 0.0))
    (view,) = board.since(0).tracks
    longer_m, shorter_m = view.axes95_m
    assert (longer_m, shorter_m) == pytest.approx(
        (2.0 * math.sqrt(CHI_SQUARE_95), math.sqrt(CHI_SQUARE_95))
    )
    assert view.bearing_rad == pytest.approx(0.0)
    assert view.floor_probability == 0.9


def test_a_way_is_kept_so_far_and_not_where_somebody_stands() -> None:
    board = Board()
    for step in range(2 * TRAIL_POINTS):
        board.publish(KEY, track(float(step), float(step)))
        board.publish(KEY, track(step + 0.5, step + 0.1))
    trails = board.since(0).trails
    assert trails is not None
    assert len(trails["r1"]) == TRAIL_POINTS
    assert trails["r1"][-1] == (2.0 * TRAIL_POINTS - 1.0, 0.0, 0.0)


def test_who_is_not_heard_is_somewhere_in_a_region_that_grows() -> None:
    board = Board()
    show(board, 10.0)
    board.publish(KEY, track(10.0, 0.0))
    show(board, 10.0 + SILENCE_S, silent(SILENCE_S))
    (still,) = board.since(0).tracks
    assert still.axes95_m == pytest.approx((2.0 * math.sqrt(CHI_SQUARE_95), 2.4477), abs=1e-3)
    assert (still.status, still.reason) == ("lost", "nothing heard for 20 s")
    show(board, 50.0 + SILENCE_S, silent(40.0 + SILENCE_S))
    (grown,) = board.since(0).tracks
    expected_m = math.sqrt(CHI_SQUARE_95 * (4.0 + (40.0 * SILENT_SPEED_M_S) ** 2))
    assert grown.axes95_m[0] == pytest.approx(expected_m)
    assert grown.time_ns == still.time_ns


def test_what_grew_before_it_was_published_does_not_grow_twice() -> None:
    board = Board()
    show(board, 100.0, silent(60.0))
    board.publish(KEY, track(40.0, 0.0))
    show(board, 100.0, silent(60.0))
    (view,) = board.since(0).tracks
    assert view.axes95_m[0] == pytest.approx(2.0 * math.sqrt(CHI_SQUARE_95))


def test_floors_come_with_the_roster() -> None:
    board = Board()
    board.publish(KEY, track(1.0, 0.0))
    board.publish(KEY, track(1.0, 0.0, "r2", down_m=-3.2))
    show(board, 2.0)
    floors = board.since(0).floors
    assert floors is not None
    assert [floor.level for floor in floors] == [1, 0]
    assert board.since(board.version).floors is None


def test_alerts_are_told_as_they_stand_and_rubbish_is_passed_over() -> None:
    board = Board()
    alert = Alert(
        event_time_ns=1, sequence=0, number=7, kind="fall", role="responder", node_id="r1",
        since_ns=1, stage="raised", words="has fallen", by=None, assigned_to=None,
    )  # fmt: skip
    board.publish("clew/v1/test/post/post/alert", encode(alert))
    board.publish("clew/v1/test/post/post/alert", b"\xc1")
    board.publish("no key at all", b"")
    assert board.since(0).alerts == [alert]


def test_what_others_put_on_their_map_is_on_ours_until_they_take_it_back() -> None:
    board = Board()

    def say(kind: str, uid: str, north_m: float | None = 1.0) -> None:
        here = None if north_m is None else LocalPosition(
            north_m=north_m, east_m=0.0, down_m=0.0, covariance_m2=(100.0, 0.0, 100.0)
        )  # fmt: skip
        word = OutsideWord(
            event_time_ns=0, sequence=0, kind=kind, uid=uid, callsign="E5", words="", position=here  # type: ignore[arg-type]
        )  # fmt: skip
        board.publish("clew/v1/test/post/tak/outside", encode(word))

    def shown() -> list[tuple[str, str, float]]:
        told = board.since(0).outside or []
        return [(one.uid, one.kind, one.position.north_m) for one in told if one.position]

    assert board.since(0).outside is None
    say("marker", "u1")
    say("mayday", "u2")
    say("message", "u3")
    say("marker", "u4", None)
    say("marker", "u1", 7.0)
    assert shown() == [("u2", "mayday", 1.0), ("u1", "marker", 7.0)]
    version = board.version
    say("cancel", "u2")
    assert board.since(version).outside is not None
    assert shown() == [("u1", "marker", 7.0)]
    for number in range(MOST_OUTSIDE + 5):
        say("marker", f"n{number}")
    assert len(shown()) == MOST_OUTSIDE


def test_of_very_many_alerts_the_first_that_are_resolved_are_forgotten() -> None:
    board = Board()
    for number in range(MOST_ALERTS + 3):
        alert = Alert(
            event_time_ns=1, sequence=0, number=number, kind="fall", role="responder",
            node_id="r1", since_ns=1, stage="resolved" if number else "raised",
            words="has fallen", by=None, assigned_to=None,
        )  # fmt: skip
        board.publish("clew/v1/test/post/post/alert", encode(alert))
    kept = [each.number for each in board.since(0).alerts]
    assert kept == [0, *range(4, MOST_ALERTS + 3)]
