"""Cursor on Target: what TAK clients need stands in it; what they say is read, whatever it is."""

from __future__ import annotations

from xml.etree.ElementTree import Element

import pytest
from defusedxml.ElementTree import fromstring
from hypothesis import given
from hypothesis import strategies as st

from command_post.gateways.cot import (
    LONGEST_EVENT_BYTES,
    Shown,
    alarm_event,
    dap_event,
    read_event,
    responder_event,
)
from command_post.gateways.tak_board import AGAIN_NS, CANCELLED_TIMES, TakBoard
from shared.codec import encode
from shared.geodesy import Geodetic, Origin
from shared.messages import Alert, AlertStage, TrackEstimate
from shared.units import NS_PER_S

NOW_NS = 1_700_000_000 * NS_PER_S
R1 = Shown("clew-fire-r1", "r1", Geodetic(37.5, 127.0, 38.0), 2.5, None)
ORIGIN = Origin(latitude_deg=37.5, longitude_deg=127.0, height_m=38.0, bearing_deg=30.0)


def attribute(event: Element, path: str, name: str) -> str:
    found = event.find(path) if path else event
    assert found is not None
    value = found.get(name)
    assert value is not None
    return value


def test_a_responder_is_friendly_ground_with_where_and_how_surely() -> None:
    event = fromstring(responder_event(R1, NOW_NS, 91.0, "tracking <&> \x07"))
    assert (event.get("type"), event.get("uid")) == ("a-f-G-U-C", "clew-fire-r1")
    assert event.get("time") == "2023-11-14T22:13:20.000Z"
    assert event.get("stale") == "2023-11-14T22:13:35.000Z"
    assert attribute(event, "point", "ce") == "2.5"
    assert float(attribute(event, "point", "le")) > 1e6
    assert attribute(event, "detail/contact", "callsign") == "r1"
    assert attribute(event, "detail/track", "course") == "91.0"
    assert event.findtext("detail/remarks") == "tracking <&>  "


def test_an_alarm_is_an_emergency_of_its_responder_until_it_is_cancelled() -> None:
    raised = fromstring(alarm_event(R1, NOW_NS, "mayday"))
    assert (raised.get("type"), raised.get("uid")) == ("b-a-o-tbl", "clew-fire-r1-9-1-1")
    assert attribute(raised, "detail/link", "uid") == "clew-fire-r1"
    assert attribute(raised, "detail/emergency", "type") == "911 Alert"
    over = fromstring(alarm_event(R1, NOW_NS, "mayday", cancelled=True))
    assert (over.get("type"), over.get("uid")) == ("b-a-o-can", raised.get("uid"))
    assert attribute(over, "detail/emergency", "cancel") == "true"


def test_a_box_is_a_marker() -> None:
    assert fromstring(dap_event(R1, NOW_NS, "stands")).get("type") == "b-m-p-s-p-loc"


WHEN = "2026-01-01T00:00:00.000Z"


def event(kind: str, detail: str = "", point: str = 'lat="37.5" lon="127" hae="38"') -> bytes:
    return (
        f'<event version="2.0" uid="u-1" type="{kind}" time="{WHEN}" start="{WHEN}" '
        f'stale="2099-01-01T00:00:00.000Z" how="h-g-i-g-o">'
        f'<point {point} ce="9" le="9"/><detail>{detail}</detail></event>'
    ).encode()


@pytest.mark.parametrize(
    ("kind", "detail", "read"),
    [
        ("b-m-p-s-m", "", "marker"),
        ("b-t-f", '<__chat senderCallsign="E5"/><remarks>to the\n roof</remarks>', "message"),
        ("b-a-o-tbl", '<contact callsign="E5"/>', "mayday"),
        ("b-a-o-can", '<contact callsign="E5"/>', "cancel"),
        ("b-a-o-tbl", '<emergency cancel="true">E5</emergency>', "cancel"),
    ],
)
def test_what_matters_is_read(kind: str, detail: str, read: str) -> None:
    heard = read_event(event(kind, detail))
    assert heard is not None
    assert (heard.kind, heard.uid) == (read, "u-1")
    assert heard.place == Geodetic(37.5, 127.0, 38.0)
    if "senderCallsign" in detail:
        assert (heard.callsign, heard.words) == ("E5", "to the roof")


@pytest.mark.parametrize(
    "data",
    [
        b"", b"<event/>", event("a-f-G-U-C"), event("t-x-c-t"), b"\xff\xfe", event("b-m-p")[:-3],
        b'<!DOCTYPE x [<!ENTITY a "aaaaaaaaaa">]>' + event("b-m-p", "&a;"),
        b"<event>" + b" " * LONGEST_EVENT_BYTES,
    ],
)  # fmt: skip
def test_what_does_not_is_passed_over(data: bytes) -> None:
    assert read_event(data) is None


@pytest.mark.parametrize(
    "point",
    ['lat="nan" lon="1" hae="1"', 'lat="100" lon="1" hae="1"', 'lat="x" lon="1" hae="1"',
     'lat="1e999" lon="1" hae="1"', 'lat="0" lon="0" hae="9999999"', 'lat="1"'],
)  # fmt: skip
def test_a_place_that_is_none_is_none(point: str) -> None:
    heard = read_event(event("b-m-p", point=point))
    assert heard is not None
    assert heard.place is None


@given(st.binary(max_size=400))
def test_any_bytes_are_survived(data: bytes) -> None:
    read_event(data)
    read_event(b"<event uid='a' type='b-m-p'>" + data + b"</event>")


def track(at_s: float) -> bytes:
    return encode(
        TrackEstimate(
            event_time_ns=round(at_s * NS_PER_S), sequence=0, responder_id="r1", north_m=10.0,
            east_m=0.0, down_m=-3.0, covariance_m2=(1.0, 0.0, 1.0), heading_rad=0.0,
            heading_sd_rad=0.1, last_proximity_time_ns=None, down_sd_m=0.5,
        )
    )  # fmt: skip


def alert(stage: AlertStage) -> bytes:
    return encode(
        Alert(
            event_time_ns=0, sequence=0, number=1, kind="mayday", role="responder", node_id="r1",
            since_ns=0, stage=stage, words="calls mayday", by=None, assigned_to=None,
        )
    )  # fmt: skip


def types(board: TakBoard, now_ns: int) -> list[str | None]:
    return [fromstring(each).get("type") for each in board.due(now_ns)]


def test_the_newest_is_told_and_what_stands_is_told_again() -> None:
    board = TakBoard("fire", ORIGIN)
    key = "clew/v1/fire/post/post/track"
    board.publish(key, track(1.0))
    board.publish(key, track(2.0))
    (told,) = map(fromstring, board.due(NOW_NS))
    assert float(attribute(told, "point", "hae")) == pytest.approx(41.0, abs=0.01)
    assert attribute(told, "detail/track", "course") == "30.0"
    assert types(board, NOW_NS + 1) == []
    assert types(board, NOW_NS + AGAIN_NS) == ["a-f-G-U-C"]


def test_an_alarm_is_repeated_and_its_end_said_a_few_times() -> None:
    board = TakBoard("fire", ORIGIN)
    board.publish("clew/v1/fire/post/post/track", track(1.0))
    board.publish("clew/v1/fire/post/post/alert", alert("raised"))
    for turn in range(3):
        assert "b-a-o-tbl" in types(board, NOW_NS + turn * AGAIN_NS)
    board.publish("clew/v1/fire/post/post/alert", alert("resolved"))
    later = [types(board, NOW_NS + turn * AGAIN_NS) for turn in range(10, 20)]
    assert [("b-a-o-can" in each) for each in later] == [
        turn < CANCELLED_TIMES for turn in range(10)
    ]


def test_an_emergency_of_somebody_without_a_track_is_told_all_the_same() -> None:
    board = TakBoard("fire", ORIGIN)
    board.publish("clew/v1/fire/post/post/alert", alert("raised"))
    (told,) = [fromstring(each) for each in board.due(NOW_NS)]
    assert told.get("type") == "b-a-o-tbl"
    assert float(attribute(told, "point", "ce")) > 1e6


def test_nothing_is_told_before_the_origin_is_known_and_all_anew_once_it_is_corrected() -> None:
    board = TakBoard("fire", None)
    board.publish("clew/v1/fire/post/post/track", track(1.0))
    assert list(board.due(NOW_NS)) == []
    set_at: list[str] = []
    for latitude_deg in (37.5, 37.6):
        origin = Origin(latitude_deg=latitude_deg, longitude_deg=127.0)
        board.publish("clew/v1/fire/post/post/origin", encode(origin.as_message(NOW_NS, 0)))
        (told,) = [fromstring(each) for each in board.due(NOW_NS)]
        set_at.append(attribute(told, "point", "lat")[:4])
    assert set_at == ["37.5", "37.6"]
