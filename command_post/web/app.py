"""The page's HTTP: its files, what there is to see, and what people may ask for.

What changes anything takes a session that may, its token in ``X-Clew-Token``, and a body of ours;
who asks for anything else gets a plain refusal, and nothing has changed.
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import suppress
from http import HTTPStatus
from importlib.resources import files
from typing import Annotated, Literal, NamedTuple, TypeAlias, TypeVar

import msgspec
from msgspec import Meta
from starlette.applications import Starlette
from starlette.middleware import Middleware
from starlette.requests import Request
from starlette.responses import Response, StreamingResponse
from starlette.routing import Mount, Route
from starlette.staticfiles import StaticFiles
from starlette.types import Receive, Scope, Send

from command_post.web.answers import RefusedError, body_of, json_answer, tell_refusal
from command_post.web.board import Changes
from command_post.web.guard import Guard
from command_post.web.page import Page
from command_post.web.people import LOCAL_NAME, Door, Role, Session
from shared.geodesy import Origin
from shared.messages import (
    AlertRequest,
    Coordinate,
    LocalPosition,
    Message,
    NodeId,
    OrderKind,
    OrderRequest,
    PositionFix,
)

TICK_S = 0.1
"""Whoever watches is told of changes so often."""

COOKIE = "clew_session"
TOKEN_HEADER = "x-clew-token"  # noqa: S105

Handler: TypeAlias = Callable[[Request], Awaitable[Response]]
T = TypeVar("T", bound=msgspec.Struct)


class SignIn(msgspec.Struct, forbid_unknown_fields=True):
    """What a person gives to sign in."""

    name: Annotated[str, Meta(max_length=64)]
    password: Annotated[str, Meta(max_length=256)]


class OrderBody(msgspec.Struct, forbid_unknown_fields=True):
    """What is to be ordered, to whom; to everybody if ``to`` is empty."""

    kind: OrderKind | Literal["withdraw"]
    to: Annotated[tuple[NodeId, ...], Meta(max_length=256)] = ()
    text: Annotated[str, Meta(max_length=200)] = ""


class AlertBody(msgspec.Struct, forbid_unknown_fields=True):
    """What becomes of an alert."""

    stage: Literal["acknowledged", "assigned", "resolved"]
    assigned_to: NodeId | None = None


class ClickBody(msgspec.Struct, forbid_unknown_fields=True):
    """Where somebody is, by a click on the map, give or take ``sd_m`` each way."""

    responder_id: NodeId
    north_m: Coordinate
    east_m: Coordinate
    down_m: Coordinate = 0.0
    sd_m: Annotated[float, Meta(gt=0.0, le=1e4)] = 2.0


class Site(NamedTuple):
    """What a page is about, and who may come in; without a ``door`` nobody needs to sign in.

    ``secure``: it is served encrypted. ``hosts``: the names it goes by; empty for any.
    ``origin``: where on the Earth the incident is, if that is known.
    """

    incident: NodeId
    post_id: NodeId
    page: Page
    door: Door | None
    secure: bool
    hosts: frozenset[str]
    origin: Origin | None = None


def make_app(site: Site, ends: Callable[[], bool]) -> Starlette:
    """Return the page of ``site``; its streams end once ``ends`` says so."""
    api = _Api(site, ends)
    static = files("command_post.web") / "static"
    return Starlette(
        routes=[
            Mount("/api/v1", routes=api.routes()),
            Mount("/", StaticFiles(directory=str(static), html=True)),
        ],
        middleware=[Middleware(Guard, hosts=site.hosts)],
        exception_handlers={RefusedError: tell_refusal},
    )


class _Api:
    def __init__(self, site: Site, ends: Callable[[], bool]) -> None:
        self._site = site
        self._ends = ends
        self._run = str(time.time_ns())
        self._frames = Frames(site.page)
        local = Session(LOCAL_NAME, "commander", "on-this-machine", float("inf"))
        self._local = local if site.door is None else None

    def routes(self) -> list[Route]:
        return [
            Route("/me", self.me),
            Route("/sign-in", self.sign_in, methods=["POST"]),
            Route("/sign-out", self.sign_out, methods=["POST"]),
            Route("/state", self.state),
            Route("/features.geojson", self.features),
            Route("/ways/out/{responder_id}", self.way_out),
            Route("/ways/rescue/{responder_id}", self.rescue),
            Route("/events", self.events),
            Route("/orders", self.order, methods=["POST"]),
            Route("/alerts/{number:int}", self.alert, methods=["POST"]),
            Route("/clicks", self.click, methods=["POST"]),
        ]

    async def me(self, request: Request) -> Response:
        session = self._session(request)
        told: dict[str, object] = {"incident": self._site.incident, "post": self._site.post_id}
        if session is not None:
            told |= {"name": session.name, "role": session.role, "token": session.token}
        return json_answer(told)

    async def sign_in(self, request: Request) -> Response:
        door, given = self._site.door, await body_of(request, SignIn)
        if door is None:
            return json_answer({})
        entered = await asyncio.to_thread(
            door.sign_in, given.name, given.password, time.monotonic()
        )
        if entered is None:
            raise RefusedError(
                HTTPStatus.FORBIDDEN, "name or password is wrong, or tried too often"
            )
        response = json_answer({"name": entered[1].name, "role": entered[1].role})
        response.set_cookie(
            COOKIE, entered[0], httponly=True, samesite="strict", secure=self._site.secure
        )
        return response

    async def sign_out(self, request: Request) -> Response:
        self._may(request, "viewer", changes=True)
        if self._site.door is not None:
            self._site.door.sign_out(request.cookies.get(COOKIE))
        response = json_answer({})
        response.delete_cookie(COOKIE)
        return response

    async def state(self, request: Request) -> Response:
        self._may(request, "viewer")
        return json_answer(await asyncio.to_thread(self._site.page.since, 0))

    async def features(self, request: Request) -> Response:
        self._may(request, "viewer")
        if self._site.origin is None:
            why = "nobody has said where on the Earth this is: start the post with --origin"
            raise RefusedError(HTTPStatus.NOT_FOUND, why)
        collection = await asyncio.to_thread(self._site.page.features, self._site.origin)
        return json_answer(collection, media_type="application/geo+json")

    async def way_out(self, request: Request) -> Response:
        self._may(request, "viewer")
        responder_id = request.path_params["responder_id"]
        way = await asyncio.to_thread(self._site.page.way_out, responder_id)
        if way is None:
            raise RefusedError(HTTPStatus.NOT_FOUND, f"no way out of {responder_id} was walked")
        return json_answer({"who": responder_id, "way": way})

    async def rescue(self, request: Request) -> Response:
        self._may(request, "viewer")
        responder_id = request.path_params["responder_id"]
        sent = await asyncio.to_thread(self._site.page.rescue, responder_id)
        if sent is None:
            raise RefusedError(HTTPStatus.NOT_FOUND, f"nobody's way to {responder_id} was walked")
        return json_answer({"who": sent[0], "way": sent[1]})

    async def events(self, request: Request) -> Response:
        self._may(request, "viewer")
        run, _, version = request.headers.get("last-event-id", "").partition("-")
        since = int(version) if run == self._run and version.isdecimal() else 0
        return Events(
            self._stream(request, since),
            media_type="text/event-stream",
            headers={"Cache-Control": "no-store"},
        )

    async def order(self, request: Request) -> Response:
        session = self._may(request, "commander", changes=True)
        given = await body_of(request, OrderBody)
        return self._asked(
            session,
            OrderRequest(
                event_time_ns=self._site.page.now_ns, sequence=self._site.page.next_number(),
                kind=given.kind, to=given.to, text=given.text,
            ),
        )  # fmt: skip

    async def alert(self, request: Request) -> Response:
        session = self._may(request, "operator", changes=True)
        given = await body_of(request, AlertBody)
        return self._asked(
            session,
            AlertRequest(
                event_time_ns=self._site.page.now_ns, sequence=self._site.page.next_number(),
                number=request.path_params["number"], stage=given.stage,
                assigned_to=given.assigned_to,
            ),
        )  # fmt: skip

    async def click(self, request: Request) -> Response:
        session = self._may(request, "commander", changes=True)
        given = await body_of(request, ClickBody)
        place = LocalPosition(
            north_m=given.north_m, east_m=given.east_m, down_m=given.down_m,
            covariance_m2=(given.sd_m**2, 0.0, given.sd_m**2),
        )  # fmt: skip
        return self._asked(
            session,
            PositionFix(
                event_time_ns=self._site.page.now_ns, sequence=self._site.page.next_number(),
                responder_id=given.responder_id, source="commander", position=place,
            ),
        )  # fmt: skip

    async def _stream(self, request: Request, since: int) -> AsyncIterator[bytes]:
        """Yield changes as server-sent events, the newest of each, as fast as they are taken."""
        while not self._ends() and not await request.is_disconnected():
            # Somebody who was signed out meanwhile is shown no more.
            self._may(request, "viewer")
            version, frame = self._frames.since(since, time.monotonic())
            if version > since or since == 0:
                yield b"id: %s-%d\nevent: changes\ndata: %s\n\n" % (
                    self._run.encode(), version, frame,
                )  # fmt: skip
                since = version
            # In step, so that what is told is made once for all who watch.
            await asyncio.sleep(TICK_S - time.monotonic() % TICK_S)

    def _asked(self, session: Session, message: Message) -> Response:
        self._site.page.ask(session.name, message)
        told = {"by": session.name, "sequence": message.sequence}
        return json_answer(told, HTTPStatus.ACCEPTED)

    def _session(self, request: Request) -> Session | None:
        if self._site.door is None:
            return self._local
        return self._site.door.session(request.cookies.get(COOKIE), time.monotonic())

    def _may(self, request: Request, role: Role, *, changes: bool = False) -> Session:
        session = self._session(request)
        if session is None:
            raise RefusedError(HTTPStatus.UNAUTHORIZED, "sign in first")
        if changes and request.headers.get(TOKEN_HEADER) != session.token:
            raise RefusedError(HTTPStatus.FORBIDDEN, f"give the session's token in {TOKEN_HEADER}")
        if not session.may(role):
            raise RefusedError(HTTPStatus.FORBIDDEN, f"a {session.role} may not; a {role} may")
        return session


class Events(StreamingResponse):
    """Server-sent events; who is too slow to hear that they are over is hung up on."""

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer until there is nothing more to tell."""
        with suppress(asyncio.CancelledError):
            await super().__call__(scope, receive, send)


class Frames:
    """Encodes what has changed, once for all who have seen the same version."""

    def __init__(self, page: Page) -> None:
        self._page = page
        self._made: dict[int, tuple[int, bytes]] = {}
        self._tick = -1.0

    def since(self, version: int, now_s: float) -> tuple[int, bytes]:
        """Return the version that is told, and what has changed up to it; the same for a tick."""
        tick = now_s // TICK_S
        if tick != self._tick:
            self._made, self._tick = {}, tick
        if version not in self._made:
            changes: Changes = self._page.since(version)
            self._made[version] = (changes.version, msgspec.json.encode(changes))
        return self._made[version]
