"""A recording's HTTP under fire, as a post's is in ``test_openapi``: nothing in it breaks."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import pytest
import schemathesis
from hypothesis import HealthCheck, given, settings
from schemathesis import GenerationMode

from command_post.review.background import Background
from command_post.review.past import Past
from command_post.review.wishes import Sources
from command_post.web import review_app
from command_post.web.calls import Call
from command_post.web.openapi import TOKEN_HEADER
from command_post.web.review_app import Exhibit, make_review_app
from command_post.web.review_calls import REVIEW_CALLS
from shared.geodesy import Origin
from tests.eventful import eventful, opened
from tests.web.test_openapi import CHECKS

EXAMPLES = 6
HERE = {"Host": "localhost"}


class _Idle(Background):
    """Begins no comparison: what a wish brings about is not looked at here."""

    def begin(self, wish: Any) -> None:
        """Pass over a wish."""


@pytest.fixture(scope="module")
def past(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Past]:
    with opened(eventful(tmp_path_factory.mktemp("fire") / "eventful.mcap")) as past:
        yield past


@pytest.fixture(scope="module")
def document(past: Past) -> Any:
    path = past.recording.paths[0]
    background = _Idle(Sources(path, plan=Path("plan")), past.begin_ns, past.end_ns)
    exhibit = Exhibit(past, background, Origin(latitude_deg=37.5, longitude_deg=127.0))
    app = make_review_app(exhibit, lambda: True)
    return schemathesis.openapi.from_asgi("/api/v1/openapi.json", app, headers=HERE)


@pytest.mark.parametrize(
    ("call", "mode"),
    [(call, mode) for call in REVIEW_CALLS for mode in GenerationMode
     if mode is GenerationMode.POSITIVE or call.takes is not None or "{" in call.path or call.asks],
    ids=lambda each: each.name.lower(),
)  # fmt: skip
def test_whatever_is_asked_of_what_was(
    monkeypatch: pytest.MonkeyPatch, document: Any, call: Call, mode: GenerationMode
) -> None:
    monkeypatch.setattr(review_app._Review, "_exported", cache(review_app._Review._exported))
    me = document["/me"]["GET"].Case().call(headers=HERE).json()
    operation = document[call.path][call.method]

    @settings(
        max_examples=EXAMPLES, deadline=None, derandomize=True,
        suppress_health_check=list(HealthCheck),
    )  # fmt: skip
    @given(case=operation.as_strategy(generation_mode=mode))
    def ask(case: Any) -> None:
        response = case.call(headers={**HERE, TOKEN_HEADER: me["token"]})
        case.validate_response(response, checks=CHECKS)
        assert "Traceback" not in response.text

    ask()
