"""The page's HTTP: what there is to see, what may be asked for, and by whom."""

from __future__ import annotations

import json
from collections.abc import Iterator
from itertools import pairwise

import pytest
from starlette.testclient import TestClient

from command_post.fusion.walls import Wall
from command_post.plans.plan_images import Plan
from command_post.plans.plan_view import PNG, PlanImage, PlanView
from command_post.web.answers import MOST_BODY_BYTES
from command_post.web.app import Site, make_app
from command_post.web.page import Page
from command_post.web.people import Door, Person, Role, hashed
from shared.codec import decode, encode, parse_key
from shared.geodesy import Geodetic, Origin
from shared.messages import AlertRequest, Message, OrderRequest, OriginSet, PositionFix
from shared.topics import Key
from tests.web.test_board import track

EVACUATE = {"kind": "evacuate", "to": [], "text": "north door"}


def client_of(page: Page, door: Door | None = None) -> TestClient:
    hosts = frozenset({"testserver"})
    site = Site("fire", "post", page, door, secure=False, hosts=hosts)
    return TestClient(make_app(site, lambda: True))


@pytest.fixture
def page() -> Page:
    return Page("fire")


@pytest.fixture
def local(page: Page) -> Iterator[TestClient]:
    with client_of(page) as client:
        client.headers["x-clew-token"] = client.get("/api/v1/me").json()["token"]
        yield client


def asked(page: Page) -> list[tuple[Key, Message]]:
    found = []
    for key_text, payload in page.take_requests():
        key = parse_key(key_text)
        assert isinstance(key, Key)
        message = decode(key, payload)
        assert isinstance(message, Message)
        found.append((key, message))
    return found


def test_an_order_is_asked_of_the_post_in_the_name_of_who_gives_it(
    page: Page, local: TestClient
) -> None:
    answer = local.post("/api/v1/orders", json=EVACUATE)
    assert answer.status_code == 202
    ((key, order),) = asked(page)
    assert (key.role, key.node_id) == ("post", "local")
    assert isinstance(order, OrderRequest)
    assert (order.kind, order.to, order.text) == ("evacuate", (), "north door")
    assert order.sequence == answer.json()["sequence"]


def test_alerts_and_clicks_likewise(page: Page, local: TestClient) -> None:
    assert local.post("/api/v1/alerts/3", json={"stage": "acknowledged"}).status_code == 202
    place = {"responder_id": "r1", "north_m": 1.5, "east_m": -2.0}
    assert local.post("/api/v1/clicks", json=place).status_code == 202
    (_, alert), (_, fix) = asked(page)
    assert isinstance(alert, AlertRequest)
    assert (alert.number, alert.stage) == (3, "acknowledged")
    assert isinstance(fix, PositionFix)
    assert (fix.responder_id, fix.source, fix.position.east_m) == ("r1", "commander", -2.0)
    assert fix.sequence > alert.sequence


@pytest.mark.parametrize(
    "body",
    [b"", b"{", b"[]", b'{"kind": "dance"}', b'{"kind": "evacuate", "to": "r1"}',
     b'{"kind": "evacuate", "to": ["../.."]}', b"\xff", b'{"kind": "message", "text": 1e999}',
     b"[" * 50_000, json.dumps({"kind": "message", "text": "x" * 300}).encode()],
)  # fmt: skip
def test_what_is_not_as_it_must_be_is_refused_and_nothing_comes_of_it(
    page: Page, local: TestClient, body: bytes
) -> None:
    answer = local.post(
        "/api/v1/orders", content=body, headers={"content-type": "application/json"}
    )
    assert answer.status_code == 400
    assert answer.json()["error"]
    assert asked(page) == []


def test_too_much_is_refused(page: Page, local: TestClient) -> None:
    answer = local.post(
        "/api/v1/orders",
        content=b" " * (MOST_BODY_BYTES + 1),
        headers={"content-type": "application/json"},
    )
    assert answer.status_code == 413
    assert local.post("/api/v1/orders", data={"kind": "evacuate"}).status_code == 415
    assert asked(page) == []


def test_without_the_token_nothing_is_done(page: Page, local: TestClient) -> None:
    answer = local.post("/api/v1/orders", json=EVACUATE, headers={"x-clew-token": "guessed"})
    assert answer.status_code == 403
    assert asked(page) == []


def test_other_pages_and_other_names_are_turned_away(page: Page, local: TestClient) -> None:
    origin = {"origin": "http://evil.example"}
    assert local.post("/api/v1/orders", json=EVACUATE, headers=origin).status_code == 403
    assert local.get("/api/v1/state", headers={"host": "evil.example"}).status_code == 403
    assert asked(page) == []
    own = {"origin": "http://testserver"}
    assert local.post("/api/v1/orders", json=EVACUATE, headers=own).status_code == 202


def test_every_answer_forbids_what_is_not_ours(local: TestClient) -> None:
    for path in ("/", "/main.js", "/api/v1/state", "/nothing"):
        headers = local.get(path).headers
        assert headers["content-security-policy"].startswith("default-src 'self'")
        assert headers["x-content-type-options"] == "nosniff"


def people(role: Role) -> Door:
    return Door({"kim": Person(role=role, password=hashed("sesame", bytes(16)))}, 0.0)


@pytest.mark.parametrize(
    ("role", "alert", "order"),
    [("viewer", 403, 403), ("operator", 202, 403), ("commander", 202, 202)],
)
def test_who_signs_in_may_do_what_their_role_may(
    page: Page, role: Role, alert: int, order: int
) -> None:
    with client_of(page, people(role)) as client:
        assert "token" not in client.get("/api/v1/me").json()
        assert client.get("/api/v1/state").status_code == 401
        assert client.get("/api/v1/events").status_code == 401
        wrong = {"name": "kim", "password": "open"}
        assert client.post("/api/v1/sign-in", json=wrong).status_code == 403
        right = {"name": "kim", "password": "sesame"}
        cookie = client.post("/api/v1/sign-in", json=right).headers["set-cookie"].lower()
        assert "httponly" in cookie
        assert "samesite=strict" in cookie
        client.headers["x-clew-token"] = client.get("/api/v1/me").json()["token"]
        assert client.get("/api/v1/state").status_code == 200
        told = client.post("/api/v1/alerts/1", json={"stage": "resolved"})
        assert told.status_code == alert
        assert client.post("/api/v1/orders", json=EVACUATE).status_code == order
        assert {key.node_id for key, _ in asked(page)} <= {"kim"}
        assert client.post("/api/v1/sign-out", json={}).status_code == 200
        assert client.get("/api/v1/state").status_code == 401


def test_there_is_a_map_for_others_once_it_is_known_where_on_the_earth_it_is(page: Page) -> None:
    with client_of(page) as client:
        assert client.get("/api/v1/features.geojson").status_code == 404
    page.published("clew/v1/fire/post/post/track", track(1.0, 0.0))
    page.published("clew/v1/fire/post/post/track", track(2.0, 10.0))
    origin = Origin(latitude_deg=37.5, longitude_deg=127.0)
    page.published("clew/v1/fire/post/post/origin", encode(origin.as_message(5, 0)))
    assert page.since(0).origin == origin
    with client_of(page) as client:
        answer = client.get("/api/v1/features.geojson")
    assert answer.headers["content-type"] == "application/geo+json"
    point, region, way = answer.json()["features"]
    longitude, latitude, _ = point["geometry"]["coordinates"]
    assert (point["properties"]["kind"], point["properties"]["id"]) == ("responder", "r1")
    assert latitude == pytest.approx(37.5 + 10.0 / 110_995.0, abs=1e-7)
    assert longitude == pytest.approx(127.0)
    ((ring,),) = region["geometry"]["coordinates"]
    assert ring[0] == ring[-1]
    area = sum(a[0] * b[1] - b[0] * a[1] for a, b in pairwise(ring))
    assert area > 0.0, "an outer ring is anticlockwise"
    assert max(corner[1] for corner in ring) > latitude
    assert len(way["geometry"]["coordinates"]) == 2


def test_ways_are_told_along_what_was_walked(page: Page, local: TestClient) -> None:
    assert local.get("/api/v1/ways/out/r1").status_code == 404
    for number in range(20):
        at = (number + 1.0, float(number))
        page.published("clew/v1/fire/post/post/track", track(*at))
        page.published("clew/v1/fire/post/post/track", track(at[0], 0.5 * number, "r2"))
    out = local.get("/api/v1/ways/out/r1").json()
    assert out["who"] == "r1"
    assert out["way"]["length_m"] == pytest.approx(19.0, abs=1.5)
    assert out["way"]["legs"][0]["turn"] == "around"
    rescue = local.get("/api/v1/ways/rescue/r1").json()
    assert rescue["who"] == "r2"
    assert rescue["way"]["length_m"] == pytest.approx(9.5, abs=1.5)
    assert local.get("/api/v1/ways/rescue/nobody").status_code == 404


def test_numbers_that_nobody_can_have_are_no_numbers(page: Page, local: TestClient) -> None:
    for number in ("9" * 5000, "-1", "x", str(2**63)):
        answer = local.post(f"/api/v1/alerts/{number}", json={"stage": "acknowledged"})
        assert answer.status_code == 404, number
        assert answer.json()["error"]
    assert asked(page) == []


def test_who_comes_back_is_told_what_has_changed_since_or_all(page: Page) -> None:
    page.published("clew/v1/fire/post/post/track", track(1.0, 0.0))
    rounds: list[bool] = []

    def ends() -> bool:
        rounds.append(len(rounds) % 2 == 1)
        return rounds[-1]

    site = Site("fire", "post", page, None, secure=False, hosts=frozenset({"testserver"}))
    with TestClient(make_app(site, ends)) as client:
        run, _, version = client.get("/api/v1/events").text.split()[1].partition("-")
        for last, whole in ((f"{run}-{version}", False), (f"{run}-{'9' * 5000}", True),
                            (f"other-{version}", True), ("x", True)):  # fmt: skip
            told = client.get("/api/v1/events", headers={"last-event-id": last})
            assert told.is_success
            assert ('"trails"' in told.text) == whole, last


def test_the_origin_is_set_through_a_place_that_somebody_knows(
    page: Page, local: TestClient
) -> None:
    door = {"latitude_deg": 37.5, "longitude_deg": 127.0, "north_m": 10.0, "east_m": -4.0}
    assert local.post("/api/v1/origin", json=door | {"bearing_deg": 30.0}).status_code == 202
    ((key, message),) = asked(page)
    assert key.topic == "origin"
    assert isinstance(message, OriginSet)
    north_m, east_m, _ = Origin.said(message).local(Geodetic(37.5, 127.0, 0.0))
    assert (north_m, east_m) == pytest.approx((10.0, -4.0), abs=1e-3)
    assert message.bearing_deg == 30.0
    for wrong in ({"latitude_deg": 91.0}, {"longitude_deg": None}, {"height_m": 1e9}):
        assert local.post("/api/v1/origin", json=door | wrong).status_code == 400
    assert asked(page) == []


def test_the_plan_is_told_and_its_images_given_to_those_who_may_see(page: Page) -> None:
    wall = Wall(0.0, 0.0, 5.0, 0.0)
    view = PlanView((wall,), (PlanImage(0, 0.0, (0.1, 0.0, 0.0, -0.1, 0.0, 0.0)),))
    hosts = frozenset({"testserver"})
    site = Site("fire", "post", page, None, secure=False, hosts=hosts, plan=Plan(view, (PNG,)))
    with TestClient(make_app(site, lambda: True)) as client:
        assert client.get("/api/v1/plan").json()["walls_m"] == [[0.0, 0.0, 5.0, 0.0]]
        assert client.get("/api/v1/plan/0").content == PNG
        assert client.get("/api/v1/plan/1").status_code == 404
    with client_of(page, people("viewer")) as client:
        assert client.get("/api/v1/plan/0").status_code == 401
