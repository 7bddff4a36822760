"""The page's HTTP under fire: what its own document allows and forbids, by who may and who may not.

Schemathesis makes requests of the document, such as it tells and such as it does not, and holds the
answers against it: none is a server's error, and none other than was told. What is asked of the
post meanwhile is looked at after each.
"""

from __future__ import annotations

from http import HTTPStatus
from pathlib import Path
from typing import Any, NamedTuple

import pytest
import schemathesis
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from schemathesis import GenerationMode
from schemathesis.checks import not_a_server_error
from schemathesis.specs.openapi.checks import (
    content_type_conformance,
    response_schema_conformance,
    status_code_conformance,
)

from command_post.web.app import Site, make_app
from command_post.web.calls import CALLS, Call
from command_post.web.openapi import COOKIE, TOKEN_HEADER, openapi_of
from command_post.web.page import Page
from command_post.web.people import RANKS, Door, Role, Session
from shared.codec import encode
from shared.geodesy import Origin
from shared.messages import AlertRequest, OrderRequest, OriginSet, PositionFix
from tests.benchmarks.page_crowd import roster
from tests.web.test_api import asked
from tests.web.test_board import KEY, track

EXAMPLES = 25
CHECKS = [
    not_a_server_error, status_code_conformance, content_type_conformance,
    response_schema_conformance,
]  # fmt: skip
TOKEN = "told-to-our-page"  # noqa: S105
TAKES: dict[type, Role] = {
    OrderRequest: "commander", PositionFix: "commander", OriginSet: "commander",
    AlertRequest: "operator",
}  # fmt: skip


class _Staff(Door):
    """Lets everybody be known who names a role."""

    def __init__(self) -> None:
        super().__init__({}, 0.0)

    def session(self, secret: str | None, now_s: float) -> Session | None:
        for role in RANKS:
            if role == secret:
                return Session(role, role, TOKEN, now_s + 1.0)
        return None


class Who(NamedTuple):
    """Who asks: as what they have signed in, and whether they have the token."""

    role: Role | None
    has_token: bool

    @property
    def headers(self) -> dict[str, str]:
        """What they send of themselves."""
        token = {TOKEN_HEADER: TOKEN} if self.has_token else {TOKEN_HEADER: "guessed"}
        return {**token, "Cookie": f"{COOKIE}={self.role or 'made-up'}"}


ALL = [Who(None, has_token=True), Who("commander", has_token=False),
       *(Who(role, has_token=True) for role in RANKS)]  # fmt: skip


@pytest.fixture(scope="module")
def page() -> Page:
    page = Page("fire")
    for number in range(20):
        page.published(KEY, track(float(number), float(number)))
    return page


@pytest.fixture(scope="module")
def document(page: Page) -> Any:
    origin = Origin(latitude_deg=37.5, longitude_deg=127.0)
    hosts = frozenset({"localhost", "testserver"})
    page.published("clew/v1/fire/post/post/origin", encode(origin.as_message(5, 0)))
    page.show(roster(3, 5))
    site = Site("fire", "post", page, _Staff(), secure=False, hosts=hosts)
    return schemathesis.openapi.from_asgi("/api/v1/openapi.json", make_app(site, ends=lambda: True))


@pytest.mark.parametrize(
    ("call", "mode"),
    [(call, mode) for call in CALLS for mode in GenerationMode
     if mode is GenerationMode.POSITIVE or call.takes is not None or "{" in call.path],
    ids=lambda each: each.name.lower(),
)  # fmt: skip
def test_whatever_is_asked(page: Page, document: Any, call: Call, mode: GenerationMode) -> None:
    operation = document[call.path][call.method]

    @settings(
        max_examples=EXAMPLES, deadline=None, derandomize=True,
        suppress_health_check=list(HealthCheck),
    )  # fmt: skip
    @given(case=operation.as_strategy(generation_mode=mode), who=st.sampled_from(ALL))
    def ask(case: Any, who: Who) -> None:
        response = case.call(headers=who.headers)
        case.validate_response(response, checks=CHECKS)
        assert "Traceback" not in response.text
        done = [message for _, message in asked(page)]
        assert len(done) == (response.status_code == HTTPStatus.ACCEPTED)
        for message in done:
            assert who.role is not None
            assert who.has_token
            assert RANKS[who.role] >= RANKS[TAKES[type(message)]]

    ask()


def test_the_document_is_told_and_written_of() -> None:
    told = openapi_of(CALLS)
    assert told["openapi"].startswith("3.1")
    assert {(path, method.upper()) for path, each in told["paths"].items() for method in each} == {
        (call.path, call.method) for call in CALLS
    }
    words = (Path(__file__).parents[2] / "docs" / "page.md").read_text()
    unwritten = [call.path for call in CALLS if _stem(call.path) not in words]
    assert unwritten == []


def _stem(path: str) -> str:
    return path.partition("{")[0]
