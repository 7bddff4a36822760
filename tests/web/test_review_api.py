"""What the page over a recording answers, and what it refuses: nothing can be changed in it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import msgspec
import pytest
from starlette.testclient import TestClient

from command_post.review.background import Background
from command_post.review.wishes import Sources
from command_post.roster_json import ROSTER
from command_post.web.review_app import Exhibit, make_review_app
from command_post.web.review_calls import REVIEW_CALLS
from tests.eventful import ALARM_S, eventful, opened


@pytest.fixture(scope="module")
def client(tmp_path_factory: pytest.TempPathFactory) -> Iterator[TestClient]:
    path: Path = eventful(tmp_path_factory.mktemp("api") / "eventful.mcap")
    with opened(path) as past:
        exhibit = Exhibit(past, Background(Sources(path), past.begin_ns, past.end_ns))
        app = make_review_app(exhibit, lambda: True)
        with TestClient(app, base_url="http://127.0.0.1") as client:
            yield client


def test_a_moment_and_what_follows_it_are_told(client: TestClient) -> None:
    assert client.get("/api/v1/me").json()["review"] is True
    moment = client.get("/api/v1/moment", params={"at_s": ALARM_S}).json()
    assert [alert["kind"] for alert in moment["alerts"]] == ["mayday"]
    params = {"after_s": ALARM_S - 1.0, "step_s": 0.5, "count": 6}
    steps = client.get("/api/v1/moments", params=params).json()
    assert ["alerts" in each for each in steps] == [False, True, False, False, False, False]
    assert ["roster" in each for each in steps] == [False, False, True, False, False, True]


def test_its_document_tells_of_all_that_is_answered(client: TestClient) -> None:
    document = client.get("/api/v1/openapi.json").json()
    named_in_paths = {"responder_id": "r1", "number": 0, "ending": "csv"}
    assert set(document["paths"]) == {call.path for call in REVIEW_CALLS}
    asked = {"at_s": ALARM_S, "after_s": 0.0, "step_s": 0.5, "count": 2}
    for call in REVIEW_CALLS:
        operation = document["paths"][call.path][call.method.lower()]
        named = {each["name"]: asked[each["name"]] for each in operation.get("parameters", ())
                 if each["in"] == "query"}  # fmt: skip
        path = call.path.format_map(named_in_paths)
        answer = client.request(call.method, f"/api/v1{path}", params=named)
        assert str(answer.status_code) in operation["responses"], call.path
        if answer.status_code == call.status and call.media_types == ("application/json",):
            told = answer.json()
            for each in told if isinstance(told, list) else [told]:
                if each.get("roster") is not None:
                    msgspec.convert(each.pop("roster"), ROSTER)
            msgspec.convert(told, call.gives)


def test_a_way_is_one_of_that_time(client: TestClient) -> None:
    early, late = (
        client.get("/api/v1/ways/out/r1", params={"at_s": at_s}).json() for at_s in (20.0, 100.0)
    )
    assert early["who"] == late["who"] == "r1"
    assert early["way"] != late["way"]
    assert client.get("/api/v1/ways/rescue/r1", params={"at_s": 100.0}).json()["who"] != "r1"
    assert client.get("/api/v1/ways/out/r9", params={"at_s": 100.0}).status_code == 404
    assert client.get("/api/v1/ways/out/r1").status_code == 400


def test_without_a_plan_nothing_is_drawn(client: TestClient) -> None:
    assert client.get("/api/v1/plan").json() == {"walls_m": [], "images": []}
    assert client.get("/api/v1/plan/0").status_code == 404


def test_beyond_its_ends_a_recording_stands_still(client: TestClient) -> None:
    last = client.get("/api/v1/moment", params={"at_s": 1e9}).json()
    assert last == client.get("/api/v1/moment", params={"at_s": 1e12}).json()
    assert client.get("/api/v1/moment", params={"at_s": -5}).json().get("tracks") is None


@pytest.mark.parametrize("at_s", ["", "x", "nan", "inf", "1;2"])
def test_what_is_no_time_is_refused(client: TestClient, at_s: str) -> None:
    assert client.get("/api/v1/moment", params={"at_s": at_s}).status_code == 400


def test_nothing_can_be_ordered_or_dealt_with(client: TestClient) -> None:
    token = {"x-clew-token": client.get("/api/v1/me").json()["token"]}
    for path in ("orders", "alerts/0", "clicks"):
        assert client.post(f"/api/v1/{path}", json={}, headers=token).status_code in (404, 405)


def test_a_comparison_takes_the_token_and_what_there_is(client: TestClient) -> None:
    token = {"x-clew-token": client.get("/api/v1/me").json()["token"]}
    wish = {"way": "smoothed", "plan": True}
    assert client.post("/api/v1/comparison", json=wish).status_code == 403
    assert client.post("/api/v1/comparison", json=wish, headers=token).status_code == 409
    bad = {"way": "guess"}
    assert client.post("/api/v1/comparison", json=bad, headers=token).status_code == 400
    assert client.get("/api/v1/comparison/result").status_code == 404
    assert client.get("/api/v1/comparison").json()["wish"] is None


def test_exports_are_files_to_be_kept(client: TestClient) -> None:
    table = client.get("/api/v1/export/incident.csv")
    assert table.headers["content-disposition"] == 'attachment; filename="rehearsal.csv"'
    assert table.text.startswith("time,responder")
    assert client.get("/api/v1/export/incident.kml").status_code == 409
    assert client.get("/api/v1/export/incident.exe").status_code == 404
