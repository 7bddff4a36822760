"""How the page answers: JSON, refusals in words, and bodies that are as they must be."""

from __future__ import annotations

from http import HTTPStatus
from typing import Any, TypeVar

import msgspec
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import Response

from command_post.web.calls import PARAMETERS
from shared.messages import NodeId

MOST_BODY_BYTES = 65_536

T = TypeVar("T", bound=msgspec.Struct)


class RefusedError(Exception):
    """A request that is not done, and why."""

    def __init__(self, status: HTTPStatus, why: str) -> None:
        super().__init__(why)
        self.status = status


def no_way_out(responder_id: NodeId) -> RefusedError:
    """Return the refusal to tell a way that nobody went."""
    return RefusedError(HTTPStatus.NOT_FOUND, f"no way out of {responder_id} was walked")


def no_way_to(responder_id: NodeId) -> RefusedError:
    """Return the refusal to tell who is soonest where nobody can come."""
    return RefusedError(HTTPStatus.NOT_FOUND, f"nobody's way to {responder_id} was walked")


async def body_of(request: Request, kind: type[T], most_bytes: int = MOST_BODY_BYTES) -> T:
    """Return what a request brings. Raises ``RefusedError``: too long, or not as it must be."""
    if not request.headers.get("content-type", "").startswith("application/json"):
        raise RefusedError(HTTPStatus.UNSUPPORTED_MEDIA_TYPE, "send application/json")
    body = b""
    async for chunk in request.stream():
        body += chunk
        if len(body) > most_bytes:
            raise RefusedError(HTTPStatus.REQUEST_ENTITY_TOO_LARGE, "send less")
    try:
        return msgspec.json.decode(body, type=kind)
    except (msgspec.MsgspecError, RecursionError, UnicodeDecodeError) as error:
        raise RefusedError(HTTPStatus.BAD_REQUEST, str(error)) from None


def parameters_of(request: Request) -> dict[str, object]:
    """Return what the path names, as it must be. Raises ``RefusedError`` for what cannot be."""
    try:
        return {
            name: msgspec.convert(text, PARAMETERS[name], strict=False)
            for name, text in request.path_params.items()
        }
    except msgspec.ValidationError as error:
        raise RefusedError(HTTPStatus.NOT_FOUND, str(error)) from None


async def tell_refusal(_: Request, refused: Exception) -> Response:
    """Answer what was refused, and why."""
    if isinstance(refused, HTTPException):
        answer = json_answer({"error": refused.detail}, HTTPStatus(refused.status_code))
        answer.headers.update(refused.headers or {})
        return answer
    status = refused.status if isinstance(refused, RefusedError) else HTTPStatus.BAD_REQUEST
    return json_answer({"error": str(refused)}, status)


def json_answer(
    told: Any,
    status: HTTPStatus = HTTPStatus.OK,
    media_type: str = "application/json",
) -> Response:
    """Answer ``told`` as JSON, for nobody to keep."""
    return Response(
        msgspec.json.encode(told),
        status_code=status,
        media_type=media_type,
        headers={"Cache-Control": "no-store"},
    )
