"""The page over a recording: any moment of it, what happened in it, and nothing to be done.

The page's files are those of a post at work. Nothing here changes what was: there is no way to
order anybody, and none to deal with an alert.
"""

from __future__ import annotations

import asyncio
import math
import secrets
from collections.abc import Awaitable, Callable
from http import HTTPStatus
from importlib.resources import files
from itertools import pairwise
from typing import NamedTuple

import msgspec
from starlette.applications import Starlette
from starlette.exceptions import HTTPException
from starlette.middleware import Middleware
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Mount, Route
from starlette.staticfiles import StaticFiles

from command_post.exports.endings import FORMATS, NEEDS_ORIGIN
from command_post.exports.material import Material, material_of
from command_post.plans.plan_images import Plan
from command_post.review.background import Background
from command_post.review.past import Past
from command_post.review.timeline import Timeline, timeline_of
from command_post.review.ways_then import WaysThen
from command_post.review.wishes import Wish
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
from command_post.web.calls import Call, Me, Nothing, Sent
from command_post.web.guard import Guard
from command_post.web.openapi import TOKEN_HEADER, openapi_of
from command_post.web.people import LOCAL_NAME
from command_post.web.review_calls import REVIEW_CALLS, Comparing
from command_post.web.serving import LOCAL_NAMES, Ends
from shared.geodesy import Origin
from shared.units import NS_PER_S

WAIT_S = 0.02
MOST_MOMENTS = 100
LONGEST_STEP_S = 600.0
ROSTER_EVERY = 3
"""Of moments that follow one another, each third one has the roster."""


class Exhibit(NamedTuple):
    """A recording to be shown: its past, what it is compared by, and where on the Earth it was.

    ``plan`` is what is drawn beneath the map.
    """

    past: Past
    background: Background
    origin: Origin | None = None
    plan: Plan = Plan()


def make_review_app(exhibit: Exhibit, ends: Ends) -> Starlette:
    """Return the page of a recording; who waits for what is not read yet goes when it ``ends``."""
    api = _Review(exhibit, ends)
    static = files("command_post.web") / "static"
    return Starlette(
        routes=[
            Mount("/api/v1", routes=api.routes()),
            Mount("/", StaticFiles(directory=str(static), html=True)),
        ],
        middleware=[Middleware(Guard, hosts=LOCAL_NAMES)],
        exception_handlers={RefusedError: tell_refusal, HTTPException: tell_refusal},
    )


class _Review:
    """Does each of ``REVIEW_CALLS``: the method of its name."""

    def __init__(self, exhibit: Exhibit, ends: Ends) -> None:
        self._past = exhibit.past
        self._ways = WaysThen(exhibit.past)
        self._background = exhibit.background
        self._origin = exhibit.origin or exhibit.past.origin()
        self._ends = ends
        self._plan = exhibit.plan
        self._token = secrets.token_urlsafe(32)
        self._line: Timeline | None = None
        self._material: Material | None = None

    def routes(self) -> list[Route]:
        """Return what is answered where."""
        return [
            Route(call.path, self._handler(call), methods=[call.method]) for call in REVIEW_CALLS
        ]

    def _handler(self, call: Call) -> Callable[[Request], Awaitable[Response]]:
        do = getattr(self, call.name)

        async def handle(request: Request) -> Response:
            request.scope["path_params"] = parameters_of(request)
            answer: Response = await do(request)
            return answer

        return handle

    async def openapi(self, _: Request) -> Response:
        """Tell other programs what can be asked for."""
        return json_answer(openapi_of(REVIEW_CALLS))

    async def me(self, _: Request) -> Response:
        """Say which incident this was."""
        settings = self._past.settings
        return json_answer(
            Me(settings.incident, settings.post_id, LOCAL_NAME, "viewer", self._token, review=True)
        )

    async def timeline(self, _: Request) -> Response:
        """Tell the recording's course, as far as it is read."""
        self._line = await asyncio.to_thread(timeline_of, self._past, self._line)
        return json_answer(self._line)

    async def moment(self, request: Request) -> Response:
        """Answer all that was shown at ``at_s``, in seconds since the beginning."""
        at_ns = await self._then(request)
        return json_answer(await asyncio.to_thread(self._past.moment, at_ns))

    async def moments(self, request: Request) -> Response:
        """Answer ``count`` changes, each ``step_s`` after the one before, from ``after_s`` on."""
        after_s = _asked(request, "after_s")
        step_s = min(max(_asked(request, "step_s"), 0.0), LONGEST_STEP_S)
        count = min(max(round(_asked(request, "count")), 0), MOST_MOMENTS)
        times_ns = [self._ns(after_s + number * step_s) for number in range(count + 1)]
        await self._is_read(times_ns[-1])

        def told() -> list[Changes]:
            """Return the changes, made on a thread of their own."""
            return [
                self._past.changes(
                    before_ns, at_ns, with_roster=number % ROSTER_EVERY == ROSTER_EVERY - 1
                )
                for number, (before_ns, at_ns) in enumerate(pairwise(times_ns))
            ]

        return json_answer(await asyncio.to_thread(told))

    async def way_out(self, request: Request) -> Response:
        """Find the way out that somebody had then, along what had been walked."""
        responder_id, at_ns = request.path_params["responder_id"], await self._then(request)
        way = await asyncio.to_thread(self._ways.way_out, responder_id, at_ns)
        if way is None:
            raise no_way_out(responder_id)
        return json_answer(Sent(responder_id, way))

    async def rescue(self, request: Request) -> Response:
        """Find who was soonest with somebody then, and by what way."""
        responder_id, at_ns = request.path_params["responder_id"], await self._then(request)
        sent = await asyncio.to_thread(self._ways.rescue, responder_id, at_ns)
        if sent is None:
            raise no_way_to(responder_id)
        return json_answer(Sent(*sent))

    async def plan(self, _: Request) -> Response:
        """Tell the building's walls, and where images of it lie."""
        return json_answer(self._plan.view)

    async def plan_image(self, request: Request) -> Response:
        """Give an image of a storey."""
        number, images = request.path_params["number"], self._plan.images
        if number >= len(images):
            raise RefusedError(HTTPStatus.NOT_FOUND, "there is no such image")
        return Response(images[number], media_type="image/png")

    async def comparison(self, _: Request) -> Response:
        """Answer what there is to compare with, and how far the newest wish is."""
        sources, progress = self._background.sources, self._background.progress
        has_plan, has_settings = sources.plan is not None, sources.settings is not None
        return json_answer(Comparing(has_plan, has_settings, *progress))

    async def compare(self, request: Request) -> Response:
        """Begin a comparison: it takes this machine's time, and nothing else."""
        if request.headers.get(TOKEN_HEADER) != self._token:
            raise RefusedError(HTTPStatus.FORBIDDEN, f"give the session's token in {TOKEN_HEADER}")
        wish, sources = await body_of(request, Wish), self._background.sources
        if (wish.plan and sources.plan is None) or (wish.settings and sources.settings is None):
            why = "there is none: start the review with --plan or --settings"
            raise RefusedError(HTTPStatus.CONFLICT, why)
        await asyncio.to_thread(self._background.begin, wish)
        return json_answer(Nothing(), HTTPStatus.ACCEPTED)

    async def compared(self, _: Request) -> Response:
        """Tell what came of the newest wish."""
        result = self._background.result
        if result is None:
            raise RefusedError(HTTPStatus.NOT_FOUND, "nothing has been compared yet")
        return json_answer(await asyncio.to_thread(msgspec.to_builtins, result))

    async def export(self, request: Request) -> Response:
        """Answer the recording in a format of ``command-post export``, to be kept."""
        ending = f".{request.path_params['ending']}"
        if ending in NEEDS_ORIGIN and self._origin is None:
            why = "nobody has said where on the Earth this was: start the review with --origin"
            raise RefusedError(HTTPStatus.CONFLICT, why)
        content = await asyncio.to_thread(self._exported, ending)
        name = f"{self._past.settings.incident}{ending}"
        return Response(
            content,
            media_type=FORMATS[ending],
            headers={"Content-Disposition": f'attachment; filename="{name}"'},
        )

    def _exported(self, ending: str) -> bytes:
        # What draws pictures is loaded once there is somebody who wants some.
        from command_post.exports.formats import exported  # noqa: PLC0415

        if self._material is None:
            self._material = material_of(self._past)
        path = self._background.sources.recording
        return exported(ending, self._material, path, self._origin)

    def _ns(self, at_s: float) -> int:
        """Return a time on the post's clock; beyond the recording there is its beginning or end."""
        past = self._past
        length_s = (past.end_ns - past.begin_ns) / NS_PER_S
        return past.begin_ns + round(min(max(at_s, 0.0), length_s) * NS_PER_S)

    async def _then(self, request: Request) -> int:
        """Return the moment that is asked for, once it can be shown."""
        at_ns = self._ns(_asked(request, "at_s"))
        await self._is_read(at_ns)
        return at_ns

    async def _is_read(self, at_ns: int) -> None:
        """Return once the estimates of a moment have been read."""
        while self._past.read_until_ns < at_ns:
            if self._ends() or self._past.failed is not None:
                why = self._past.failed or "it ends"
                raise RefusedError(HTTPStatus.SERVICE_UNAVAILABLE, why)
            await asyncio.sleep(WAIT_S)


def _asked(request: Request, name: str) -> float:
    """Return what is asked for as ``name``; refuse what is no finite number."""
    text = request.query_params.get(name, "")
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise RefusedError(HTTPStatus.BAD_REQUEST, f"{name}={text!r}: give a number")
    return value
