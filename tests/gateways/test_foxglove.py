"""What Foxglove is to draw: of its own library's types, once a second, turned as the Earth is."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import jsonschema
import msgspec
import numpy as np
import pytest
from mcap.reader import make_reader
from msgspec import structs

from command_post.desks.announcer import Outgoing
from command_post.gateways.foxglove import FRAME, MAP_PERIOD_NS, FoxgloveBoard
from command_post.gateways.foxglove_schemas import (
    Drawable,
    FrameTransform,
    GeoJSON,
    LocationFix,
    Log,
    SceneUpdate,
    Time,
    drawable_schema,
)
from command_post.recorder.file import RecordingFile
from command_post.recorder.mirror import Mirror
from command_post.recorder.recording import RecordedIncident
from command_post.recorder.salvage import salvage
from command_post.replay import replay
from shared.codec import encode
from shared.geodesy import Origin
from shared.mcap_reader import read_recording
from shared.messages import (
    Alert,
    DapEstimate,
    DapInstallation,
    LocalPosition,
    Message,
    Order,
    OriginSet,
    OutsideWord,
    TrackEstimate,
)
from shared.units import NS_PER_S
from tests.traffic import Tally, traffic

foxglove = pytest.importorskip("foxglove.messages")

ORIGIN = Origin(latitude_deg=37.5, longitude_deg=127.0, height_m=38.0, bearing_deg=30.0)
NOW_NS = 1_800_000_000 * NS_PER_S
RING = ((0.0, 0.0), (2.0, 0.0), (2.0, 3.0))


def track(after_s: float = 0.0, **fields: Any) -> TrackEstimate:
    told: dict[str, Any] = {
        "event_time_ns": NOW_NS + round(after_s * NS_PER_S), "sequence": 0, "responder_id": "r1",
        "north_m": 10.0, "east_m": 4.0, "down_m": -3.0, "covariance_m2": (4.0, 1.0, 2.0),
        "heading_rad": 0.0, "heading_sd_rad": 0.1, "last_proximity_time_ns": None,
    }  # fmt: skip
    return TrackEstimate(**told | fields)


HERE = LocalPosition(north_m=1.0, east_m=2.0, down_m=0.0, covariance_m2=(1.0, 0.0, 1.0))
SAID: tuple[Message, ...] = (
    track(),
    track(1.0, regions_m=(RING, RING), status="lost", heading_sd_rad=3.0),
    DapEstimate(event_time_ns=NOW_NS, sequence=0, dap_id="d1", position=HERE),
    Alert(
        event_time_ns=NOW_NS, sequence=0, number=1, kind="mayday", role="responder", node_id="r1",
        since_ns=NOW_NS, stage="raised", words="calls mayday", by=None, assigned_to=None,
    ),
    Order(event_time_ns=NOW_NS, sequence=0, kind="evacuate", to=(), text=""),
    OutsideWord(
        event_time_ns=NOW_NS, sequence=0, kind="message", uid="u", callsign="E5",
        words="water is on", position=None,
    ),
)  # fmt: skip


def drawn(message: Message, origin: Origin | None = ORIGIN) -> dict[type, Drawable]:
    return {
        type(each.message): each.message for each in FoxgloveBoard(origin).take(message, NOW_NS)
    }


KINDS = {
    "level": "LogLevel",
    "type": "LinePrimitiveLineType",
    "position_covariance_type": "LocationFixPositionCovarianceType",
}


def as_foxglove_has_it(value: Any, name: str = "") -> Any:
    """Build a message of Foxglove's library, which refuses what it does not know."""
    if isinstance(value, list):
        return [as_foxglove_has_it(each, name) for each in value]
    if name in KINDS:
        kinds = vars(getattr(foxglove, KINDS[name])).values()
        return next(each for each in kinds if each == value)
    if not isinstance(value, msgspec.Struct):
        return value
    if isinstance(value, Time):
        return (foxglove.Duration if name == "lifetime" else foxglove.Timestamp)(
            value.sec, value.nsec
        )
    own = {"GeoJSON": "GeoJson", "Vector3": "Point3" if name == "points" else "Vector3"}
    kind = type(value).__name__
    fields = structs.asdict(value)
    return getattr(foxglove, own.get(kind, kind))(
        **{each: as_foxglove_has_it(fields[each], each) for each in fields}
    )


def test_foxgloves_own_library_takes_every_field() -> None:
    board = FoxgloveBoard(ORIGIN)
    drawings = [each for message in SAID for each in board.take(message, message.event_time_ns)]
    assert {type(each.message) for each in drawings} == {
        SceneUpdate, FrameTransform, LocationFix, GeoJSON, Log
    }  # fmt: skip
    for drawing in drawings:
        assert as_foxglove_has_it(drawing.message).encode()
        data = json.loads(msgspec.json.encode(drawing.message))
        jsonschema.validate(data, json.loads(drawable_schema(type(drawing.message))))


def test_a_responder_is_told_once_a_second_and_the_map_more_rarely() -> None:
    board = FoxgloveBoard(ORIGIN)
    topics = [
        each.topic
        for tenth in range(10 * MAP_PERIOD_NS // NS_PER_S)
        for each in board.take(track(tenth / 10.0), NOW_NS + tenth * NS_PER_S // 10)
    ]
    assert topics.count("/responders/r1/scene") == topics.count("/responders/r1/location") == 10
    assert topics.count("/map") == 1
    assert list(board.take(track(), NOW_NS - 60 * NS_PER_S))


def test_the_scene_has_east_north_up_and_the_way_somebody_faces() -> None:
    told = drawn(track(heading_rad=math.radians(90.0)))
    frame, scene = told[FrameTransform], told[SceneUpdate]
    assert isinstance(frame, FrameTransform)
    assert isinstance(scene, SceneUpdate)
    assert structs.astuple(frame.translation) == (4.0, 10.0, 3.0)
    # An arrow along x faces east as it is.
    assert structs.astuple(frame.rotation) == (0.0, 0.0, 0.0, 1.0)
    (entity,) = scene.entities
    assert (entity.frame_id, entity.id) == (FRAME, "r1")
    assert len(entity.arrows) == len(entity.cylinders) == 1
    unsure = drawn(track(heading_sd_rad=2.0, regions_m=(RING,), status="dead_reckoning"))
    scene = unsure[SceneUpdate]
    assert isinstance(scene, SceneUpdate)
    (entity,) = scene.entities
    assert (entity.arrows, entity.cylinders) == ([], [])
    assert [(point.x, point.y) for point in entity.lines[0].points] == [(0, 0), (0, 2), (3, 2)]
    assert entity.texts[0].text == "r1, dead reckoning"


def test_the_covariance_is_of_true_east_and_north() -> None:
    fix = drawn(track(down_sd_m=2.0))[LocationFix]
    assert isinstance(fix, LocationFix)
    turn = math.radians(ORIGIN.bearing_deg)
    # Columns: the incident's north and east, in true east and north.
    axes = np.array([[math.sin(turn), math.cos(turn)], [math.cos(turn), -math.sin(turn)]])
    expected = axes @ np.array([[4.0, 1.0], [1.0, 2.0]]) @ axes.T
    found = np.reshape(fix.position_covariance, (3, 3))
    assert found[:2, :2] == pytest.approx(expected, abs=0.006)
    assert found[2, 2] == 4.0


def test_without_an_origin_there_is_no_map() -> None:
    assert drawn(track(), origin=None).keys() == {SceneUpdate, FrameTransform}


@pytest.mark.parametrize(
    ("message", "words", "level"),
    [
        (SAID[3], "mayday r1 raised: calls mayday", 5),
        (SAID[4], "evacuate to everybody", 3),
        (SAID[5], "message of E5: water is on", 2),
    ],
)
def test_what_is_said_stands_in_the_log(message: Message, words: str, level: int) -> None:
    log = drawn(message)[Log]
    assert isinstance(log, Log)
    assert (log.message, log.level) == (words, level)


def recorded(path: Path, mirror: Mirror | None) -> Path:
    file = RecordingFile(path, {"incident": "test"}, mirror=mirror)
    incident = RecordedIncident(Tally(), file)
    for now_ns, key, payload in traffic(40):
        incident.handle(key, payload, now_ns)
        file.sync()
    incident.finish(now_ns)
    file.finish()
    return path


def test_what_is_drawn_is_in_the_file_and_changes_nothing_of_the_record(tmp_path: Path) -> None:
    plain = list(read_recording(recorded(tmp_path / "plain.mcap", None)))
    recording = read_recording(recorded(tmp_path / "drawn.mcap", Mirror(ORIGIN)))
    assert list(recording) == plain
    assert recording.report.complete
    assert replay(recording.path, Tally()).identical
    with recording.path.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        looks = [
            (schema.name, json.loads(message.data))
            for schema, channel, message in reader.iter_messages()
            if schema is not None and channel.message_encoding == "json"
        ]
    assert len(looks) == recording.report.derived_count
    assert {name for name, _ in looks} == {
        "foxglove.SceneUpdate", "foxglove.FrameTransform", "foxglove.LocationFix",
        "foxglove.GeoJSON",
    }  # fmt: skip


def test_salvage_draws_what_is_wanted_of_an_old_recording(tmp_path: Path) -> None:
    old = recorded(tmp_path / "old.mcap", None)
    salvage(old, tmp_path / "new.mcap", Mirror(None))
    new = read_recording(tmp_path / "new.mcap")
    assert list(new) == list(read_recording(old))
    assert new.report.derived_count > 0


def test_a_killed_recording_with_drawings_is_gone_on_with(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    file = RecordingFile(path, {"incident": "test"}, mirror=Mirror(ORIGIN))
    sent = list(traffic(80))
    incident = RecordedIncident(Tally(), file)
    for now_ns, key, payload in sent:
        incident.handle(key, payload, now_ns)
    file.sync()
    file.abandon()
    before = list(read_recording(file.part))
    again = RecordingFile(path, {"incident": "test"}, resume=True, mirror=Mirror(ORIGIN))
    assert again.is_resumed
    for now_ns, key, payload in sent[:5]:
        again.put(key, payload, now_ns)
    again.finish()
    recording = read_recording(path)
    assert len(list(recording)) == len(before) + 5
    assert recording.report.complete
    assert recording.report.derived_count > 0


def test_a_post_that_was_killed_draws_on_where_it_was(tmp_path: Path) -> None:
    said = OriginSet(
        event_time_ns=NOW_NS, sequence=0, latitude_deg=37.5, longitude_deg=127.0, height_m=0.0,
        bearing_deg=0.0,
    )  # fmt: skip
    mirror = Mirror(None)
    mirror.recall(
        [
            Outgoing("clew/v1/fire/post/post/origin", encode(said)),
            Outgoing("clew/v1/fire/post/post/dap_place", encode(SAID[2])),
        ]
    )
    mirror.take("post", track(), NOW_NS, outgoing=True)
    topics = {each.topic: each.data for each in mirror.take_all()}
    assert "/responders/r1/location" in topics
    assert b"access_point" in topics["/map"]
    assert "/daps/d1" not in topics
    mirror.draw_again()
    mirror.take("post", track(2.0), NOW_NS + 2 * NS_PER_S, outgoing=True)
    assert "/daps/d1" in {each.topic for each in mirror.take_all()}


def test_an_access_point_that_was_taken_up_is_drawn_no_more() -> None:
    mirror = Mirror(None)
    mirror.take("post", SAID[2], NOW_NS, outgoing=True)
    taken_up = DapInstallation(event_time_ns=NOW_NS, sequence=1, installer_id=None, position=None)
    for name in ("d2", "d1", "d1"):
        mirror.take(name, taken_up, NOW_NS + 1, outgoing=False)
    shown, gone = (json.loads(each.data) for each in mirror.take_all())
    assert [each["id"] for each in shown["entities"]] == ["d1"]
    assert [each["id"] for each in gone["deletions"]] == ["d1"]
    assert gone["entities"] == []
