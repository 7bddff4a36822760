"""A moment of a recording is what the page showed then, whichever way one comes to it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgspec
import pytest

from command_post.recorder.file import RecordingFile
from command_post.review.past import Past
from command_post.review.timeline import timeline_of
from command_post.review.ways_then import WaysThen
from command_post.web.board import Board, Changes
from command_post.web.pathfinder import Pathfinder
from shared.mcap_index import IndexedRecording
from shared.mcap_reader import RecordingError, read_recording
from shared.messages import Alert
from shared.units import NS_PER_S
from tests.eventful import (
    ACKNOWLEDGED_S,
    ALARM_S,
    ORDER_S,
    REPLY_S,
    RESOLVED_S,
    SILENT_FROM_S,
    SILENT_TO_S,
    eventful,
    opened,
)


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return eventful(tmp_path_factory.mktemp("past") / "eventful.mcap")


@pytest.fixture(scope="module")
def past(path: Path) -> Iterator[Past]:
    with opened(path) as past:
        yield past


def at(past: Past, after_s: float) -> int:
    return past.begin_ns + round(after_s * NS_PER_S)


def rows(changes: Changes) -> dict[str, Any]:
    assert changes.roster is not None
    roster = msgspec.json.decode(changes.roster)
    return {row["responder_id"]: row for row in roster["responders"]}


@pytest.mark.parametrize("after_s", [3.0, 61.0, 200.0])
def test_tracks_trails_and_alerts_are_those_the_page_had(
    past: Past, path: Path, after_s: float
) -> None:
    board = Board()
    for each in read_recording(path):
        if each.outgoing and each.log_time_ns <= at(past, after_s):
            board.publish(each.key, each.payload)
    board.show(past.roster(at(past, after_s)))
    then, told = board.since(0), past.moment(at(past, after_s))
    assert told.sites == (then.sites or [])
    assert told.trails == then.trails
    assert told.alerts == then.alerts
    shown = {view.responder_id: view for view in told.tracks if view.status != "lost"}
    assert shown == {view.responder_id: view for view in then.tracks if view.responder_id in shown}
    assert shown


def test_ways_are_those_the_page_would_have_found(past: Past, path: Path) -> None:
    ways = WaysThen(past)
    for after_s in (61.0, 200.0, 25.0):
        then_ns, live = at(past, after_s), Pathfinder()
        for each in read_recording(path):
            if each.outgoing and each.log_time_ns <= then_ns:
                live.publish(each.key, each.payload)
        live.show(past.roster(then_ns))
        for name in ("r1", "r2", "nobody"):
            assert ways.way_out(name, then_ns) == live.way_out(name)
            assert ways.rescue(name, then_ns) == live.rescue(name)
        assert ways.way_out("r1", then_ns) is not None
    assert past.moment(at(past, 200.0)).sites != past.moment(at(past, 25.0)).sites


def test_steps_come_to_the_same_as_going_there_at_once(past: Past) -> None:
    tracks = {view.responder_id: view for view in past.moment(at(past, 20.0)).tracks}
    alerts: dict[int, Alert] = {}
    for step in range(100):
        changes = past.changes(at(past, 20.0 + step), at(past, 21.0 + step), with_roster=True)
        tracks |= {view.responder_id: view for view in changes.tracks}
        alerts |= {alert.number: alert for alert in changes.alerts}
    there = past.moment(at(past, 120.0))
    assert tracks == {view.responder_id: view for view in there.tracks}
    assert list(alerts.values()) == there.alerts
    assert rows(changes) == rows(there)


def test_the_roster_has_alarms_orders_and_who_was_silent(past: Past) -> None:
    assert rows(past.moment(at(past, ALARM_S - 1.0)))["r2"]["alarm"] is None
    assert rows(past.moment(at(past, ALARM_S + 1.0)))["r2"]["alarm"]["kind"] == "mayday"
    assert rows(past.moment(at(past, ORDER_S - 1.0)))["r2"]["orders"] == []
    ordered = rows(past.moment(at(past, ORDER_S + 1.0)))
    assert {len(row["orders"]) for row in ordered.values()} == {1}
    replied = rows(past.moment(at(past, REPLY_S + 1.0)))
    assert {name: len(row["orders"]) for name, row in replied.items()} == {
        "r1": 0, "r2": 1, "r3": 0
    }  # fmt: skip
    assert ordered == rows(past.moment(at(past, ORDER_S + 1.0))), "back again"


def test_the_time_line_says_what_happened_when_and_by_whom(past: Past) -> None:
    line = timeline_of(past)
    mayday, evacuate = line.marks
    assert (mayday.kind, mayday.node_id, mayday.at_s) == ("mayday", "r2", ALARM_S)
    assert [(step.at_s, step.stage, step.by) for step in mayday.steps] == [
        (ALARM_S, "raised", None),
        (ACKNOWLEDGED_S, "acknowledged", "kim"),
        (RESOLVED_S, "resolved", "kim"),
    ]
    assert (evacuate.kind, evacuate.at_s, evacuate.node_id) == ("evacuate", ORDER_S, "kim")
    assert {(step.stage, step.by) for step in evacuate.steps[1:]} == {
        ("acknowledged", "r1"), ("acknowledged", "r3")
    }  # fmt: skip
    assert (mayday.awaited, evacuate.awaited) == ((), ("r2",))
    (gap,) = line.gaps
    assert SILENT_FROM_S - 1.0 <= gap.from_s <= SILENT_FROM_S
    assert SILENT_TO_S <= gap.to_s <= SILENT_TO_S + 1.0
    assert gap.words == "nothing was received"
    assert line.faults == []
    assert line.read_s == line.length_s


def test_a_recording_that_was_broken_off_is_shown_as_far_as_it_is_there(
    path: Path, tmp_path: Path
) -> None:
    part = tmp_path / "broken.mcap.part"
    content = path.read_bytes()
    part.write_bytes(content[: round(0.8 * len(content))])
    with opened(part) as broken:
        line = timeline_of(broken)
        assert ALARM_S < line.length_s < 220.0
        assert line.faults[0].startswith("unfinished")
        assert rows(broken.moment(at(broken, ALARM_S + 1.0)))["r2"]["alarm"]["kind"] == "mayday"


def test_what_does_not_say_what_it_is_of_is_refused(tmp_path: Path) -> None:
    RecordingFile(tmp_path / "a.mcap", {}).finish()
    with (
        IndexedRecording([tmp_path / "a.mcap"]) as recording,
        pytest.raises(RecordingError, match="does not say its settings"),
    ):
        Past(recording)
