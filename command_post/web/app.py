"""The page's HTTP: its files, what there is to see, and what people may ask for.

What changes anything takes a session that may, its token in ``X-Clew-Token``, and a body of ours;
who asks for anything else gets a plain refusal, and nothing has changed.
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import AsyncIterator, Awaitable, Callable, Mapping
from contextlib import suppress
from http import HTTPStatus
from importlib.resources import files
from types import MappingProxyType
from typing import NamedTuple, TypeAlias

import msgspec
from starlette.applications import Starlette
from starlette.exceptions import HTTPException
from starlette.middleware import Middleware
from starlette.requests import Request
from starlette.responses import Response, StreamingResponse
from starlette.routing import Mount, Route
from starlette.staticfiles import StaticFiles
from starlette.types import Receive, Scope, Send

from command_post.plans.plan_images import Plan
from command_post.web.answers import (
    RefusedError,
    body_of,
    json_answer,
    no_way_out,
    no_way_to,
    parameters_of,
    tell_refusal,
)
from command_post.web.board import Changes
from command_post.web.calls import (
    CALLS,
    AlertBody,
    Asked,
    Call,
    ClickBody,
    Me,
    Nothing,
    OrderBody,
    OriginBody,
    Sent,
    SignedIn,
    SignIn,
)
from command_post.web.guard import Guard
from command_post.web.openapi import COOKIE, TOKEN_HEADER, openapi_of
from command_post.web.page import Page
from command_post.web.people import LOCAL_NAME, Door, Role, Session
from shared.geodesy import Geodetic, Origin
from shared.messages import (
    AlertRequest,
    LocalPosition,
    Message,
    NodeId,
    OrderRequest,
    PositionFix,
)

TICK_S = 0.1
"""Whoever watches is told of changes so often."""

LONGEST_VERSION = 19

Handler: TypeAlias = Callable[[Request], Awaitable[Response]]


class Site(NamedTuple):
    """What a page is about, and who may come in; without a ``door`` nobody needs to sign in.

    ``secure``: it is served encrypted. ``hosts``: the names it goes by; empty for any.
    ``plan``: what is drawn beneath the map. ``teams``: who is of which, and can be ordered at once.
    """

    incident: NodeId
    post_id: NodeId
    page: Page
    door: Door | None
    secure: bool
    hosts: frozenset[str]
    plan: Plan = Plan()
    teams: Mapping[NodeId, tuple[NodeId, ...]] = MappingProxyType({})


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
        exception_handlers={RefusedError: tell_refusal, HTTPException: tell_refusal},
    )


class _Api:
    """Does each of ``CALLS``: the method of its name, given the request, who asks, and the body."""

    def __init__(self, site: Site, ends: Callable[[], bool]) -> None:
        self._site = site
        self._ends = ends
        self._run = str(time.time_ns())
        self._frames = Frames(site.page)
        local = Session(LOCAL_NAME, "commander", "on-this-machine", float("inf"))
        self._local = local if site.door is None else None

    def routes(self) -> list[Route]:
        """Return what is answered where."""
        return [Route(call.path, self._handler(call), methods=[call.method]) for call in CALLS]

    def _handler(self, call: Call) -> Handler:
        """Return what answers a call: whether it may is settled before anybody looks at it."""
        do = getattr(self, call.name)

        async def handle(request: Request) -> Response:
            """Let in who may, read what they bring, and answer."""
            if call.role is None:
                session = self._session(request)
            else:
                session = self._may(request, call.role, changes=call.method == "POST")
            request.scope["path_params"] = parameters_of(request)
            if call.takes is None:
                answer: Response = await do(request, session)
            else:
                answer = await do(request, session, await body_of(request, call.takes))
            return answer

        return handle

    async def openapi(self, _: Request, __: Session | None) -> Response:
        """Tell other programs what can be asked for."""
        return json_answer(openapi_of(CALLS))

    async def me(self, _: Request, session: Session | None) -> Response:
        """Say which incident this is, and who asks."""
        me = Me(self._site.incident, self._site.post_id)
        if session is not None:
            me.name, me.role, me.token = session.name, session.role, session.token
            me.teams = dict(self._site.teams)
        return json_answer(me)

    async def sign_in(self, _: Request, __: Session | None, given: SignIn) -> Response:
        """Begin a session, which the browser keeps where no script reads it."""
        door = self._site.door
        if door is None:
            return json_answer(SignedIn())
        entered = await asyncio.to_thread(
            door.sign_in, given.name, given.password, time.monotonic()
        )
        if entered is None:
            raise RefusedError(
                HTTPStatus.FORBIDDEN, "name or password is wrong, or tried too often"
            )
        secret, session = entered
        response = json_answer(SignedIn(session.name, session.role))
        response.set_cookie(
            COOKIE, secret, httponly=True, samesite="strict", secure=self._site.secure
        )
        return response

    async def sign_out(self, request: Request, _: Session) -> Response:
        """End the session."""
        if self._site.door is not None:
            self._site.door.sign_out(request.cookies.get(COOKIE))
        response = json_answer(Nothing())
        response.delete_cookie(COOKIE)
        return response

    async def state(self, _: Request, __: Session) -> Response:
        """Tell all there is to see."""
        return json_answer(await asyncio.to_thread(self._site.page.since, 0))

    async def features(self, _: Request, __: Session) -> Response:
        """Tell who and what is where on the Earth, once that is known."""
        collection = await asyncio.to_thread(self._site.page.features)
        if collection is None:
            why = "nobody has said where on the Earth this is: set the incident's origin"
            raise RefusedError(HTTPStatus.NOT_FOUND, why)
        return json_answer(collection, media_type="application/geo+json")

    async def way_out(self, request: Request, _: Session) -> Response:
        """Find somebody's way out, along what was walked."""
        responder_id = request.path_params["responder_id"]
        way = await asyncio.to_thread(self._site.page.way_out, responder_id)
        if way is None:
            raise no_way_out(responder_id)
        return json_answer(Sent(responder_id, way))

    async def rescue(self, request: Request, _: Session) -> Response:
        """Find who is soonest with somebody, and by what way."""
        responder_id = request.path_params["responder_id"]
        sent = await asyncio.to_thread(self._site.page.rescue, responder_id)
        if sent is None:
            raise no_way_to(responder_id)
        return json_answer(Sent(*sent))

    async def events(self, request: Request, _: Session) -> Response:
        """Tell what changes, as it does; all there is to who knows no version of this run."""
        run, version = request.headers.get("last-event-id", "").partition("-")[::2]
        known = run == self._run and version.isdecimal() and len(version) < LONGEST_VERSION
        return Events(
            self._stream(request, int(version) if known else 0),
            media_type="text/event-stream",
            headers={"Cache-Control": "no-store"},
        )

    async def plan(self, _: Request, __: Session) -> Response:
        """Tell the building's walls, and where images of it lie."""
        return json_answer(self._site.plan.view)

    async def plan_image(self, request: Request, _: Session) -> Response:
        """Give an image of a storey."""
        number, images = request.path_params["number"], self._site.plan.images
        if number >= len(images):
            raise RefusedError(HTTPStatus.NOT_FOUND, "there is no such image")
        return Response(images[number], media_type="image/png")

    async def order(self, _: Request, session: Session, given: OrderBody) -> Response:
        """Ask the post to order somebody to do something."""
        return self._asked(
            session,
            OrderRequest(
                event_time_ns=self._site.page.now_ns, sequence=self._site.page.next_number(),
                kind=given.kind, to=given.to, text=given.text,
            ),
        )  # fmt: skip

    async def alert(self, request: Request, session: Session, given: AlertBody) -> Response:
        """Ask the post to take an alert a stage further."""
        return self._asked(
            session,
            AlertRequest(
                event_time_ns=self._site.page.now_ns, sequence=self._site.page.next_number(),
                number=request.path_params["number"], stage=given.stage,
                assigned_to=given.assigned_to,
            ),
        )  # fmt: skip

    async def click(self, _: Request, session: Session, given: ClickBody) -> Response:
        """Ask the post to hold that somebody is at a place."""
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

    async def set_origin(self, _: Request, session: Session, given: OriginBody) -> Response:
        """Ask the post to hold that a place of the incident is there on the Earth."""
        page = self._site.page
        at = Geodetic(given.latitude_deg, given.longitude_deg, given.height_m)
        origin = Origin.through(at, given.bearing_deg, (given.north_m, given.east_m))
        return self._asked(session, origin.as_message(page.now_ns, page.next_number()))

    async def _stream(self, request: Request, since: int) -> AsyncIterator[bytes]:
        """Yield changes as server-sent events, the newest of each, as fast as they are taken."""
        while not self._ends() and not await request.is_disconnected():
            if self._session(request) is None:
                # Somebody who was signed out meanwhile is shown no more.
                return
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
        return json_answer(Asked(session.name, message.sequence), HTTPStatus.ACCEPTED)

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
