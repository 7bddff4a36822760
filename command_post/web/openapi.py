"""The page's HTTP as an OpenAPI 3.1 document, for other programs (pure)."""

from __future__ import annotations

import re
from collections.abc import Iterable
from http import HTTPStatus
from typing import Any, TypeAlias

import msgspec

from command_post.roster_json import ROSTER
from command_post.web.answers import MOST_BODY_BYTES
from command_post.web.calls import PARAMETERS, Call, Refusal

Document: TypeAlias = dict[str, Any]

COOKIE = "clew_session"
TOKEN_HEADER = "x-clew-token"  # noqa: S105

_PARAMETER = re.compile(r"\{(\w+)\}")
_BODY = (
    HTTPStatus.BAD_REQUEST,
    HTTPStatus.REQUEST_ENTITY_TOO_LARGE,
    HTTPStatus.UNSUPPORTED_MEDIA_TYPE,
)


def openapi_of(calls: Iterable[Call]) -> Document:
    """Return the document of ``calls``, all of them under ``/api/v1``; one tells ``Changes``."""
    calls = tuple(calls)
    kinds = dict.fromkeys(
        kind for call in calls for kind in (call.gives, call.takes) if kind is not None
    )
    told = (*kinds, Refusal, ROSTER)
    schemas, components = msgspec.json.schema_components(
        told, ref_template="#/components/schemas/{name}"
    )
    schema_of = dict(zip(told, schemas, strict=True))
    # What is encoded once for all who watch says nothing of itself.
    encoded = {"anyOf": [schema_of[ROSTER], {"type": "null"}], "default": None}
    components["Changes"]["properties"]["roster"] = encoded
    paths: Document = {}
    for call in calls:
        paths.setdefault(call.path, {})[call.method.lower()] = _operation(call, schema_of)
    return {
        "openapi": "3.1.0",
        "info": {
            "title": "Clew, the commander's page",
            "version": "1",
            "description": "Where nobody needs to sign in, the session's cookie is not looked at.",
        },
        "servers": [{"url": "/api/v1"}],
        "paths": paths,
        "components": {
            "schemas": components,
            "securitySchemes": {
                "session": {"type": "apiKey", "in": "cookie", "name": COOKIE},
                "token": {"type": "apiKey", "in": "header", "name": TOKEN_HEADER},
            },
        },
    }


def _operation(call: Call, schema_of: dict[Any, Document]) -> Document:
    answered = {"description": call.says, "content": _content(schema_of[call.gives], call)}
    refused = _content(schema_of[Refusal])
    told: Document = {
        "operationId": call.name,
        "summary": call.says,
        "responses": {
            str(call.status.value): answered,
            **{
                str(status.value): {"description": status.phrase, "content": refused}
                for status in _refusals(call)
            },
        },
    }
    named = _PARAMETER.findall(call.path)
    if named or call.asks:
        told["parameters"] = [
            *(_parameter(name, "path", PARAMETERS[name]) for name in named),
            *(_parameter(name, "query", kind) for name, kind in call.asks.items()),
        ]
    if call.takes is not None:
        told["requestBody"] = {
            "required": True,
            "description": f"Of {MOST_BODY_BYTES} bytes at most.",
            "content": _content(schema_of[call.takes]),
        }
    if call.role is not None:
        told["x-clew-role"] = call.role
        token: Document = {"token": []} if call.method == "POST" else {}
        told["security"] = [{"session": [], **token}]
    return told


def _parameter(name: str, where: str, kind: Any) -> Document:
    return {"name": name, "in": where, "required": True, "schema": msgspec.json.schema(kind)}


def _refusals(call: Call) -> list[HTTPStatus]:
    by_role = () if call.role is None else (HTTPStatus.UNAUTHORIZED, HTTPStatus.FORBIDDEN)
    by_body = () if call.takes is None else _BODY
    return sorted({*by_role, *by_body, *call.refuses})


def _content(schema: Document, call: Call | None = None) -> Document:
    media_types = ("application/json",) if call is None else call.media_types
    return {media_type: {"schema": schema} for media_type in media_types}
