"""The one table of what the page's HTTP does (pure): what is called how, and who may.

The routes are made of it, whether somebody may is looked up in it before anything is done, and the
document that tells other programs is written from it. What changes anything is a ``POST``.
"""

from __future__ import annotations

from collections.abc import Mapping
from http import HTTPStatus
from types import MappingProxyType
from typing import Annotated, Any, Literal, NamedTuple

import msgspec
from msgspec import Meta

from command_post.nodes.teams import Crews
from command_post.plans.plan_view import PlanView
from command_post.ways import Way
from command_post.web.board import Changes
from command_post.web.people import Role
from shared.messages import Coordinate, NodeId, OrderKind, Sequence


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


class OriginBody(msgspec.Struct, forbid_unknown_fields=True):
    """Where on the Earth a place of the incident is, and how far its north is off true north."""

    latitude_deg: Annotated[float, Meta(ge=-90.0, le=90.0)]
    longitude_deg: Annotated[float, Meta(ge=-180.0, le=180.0)]
    height_m: Annotated[float, Meta(ge=-1e4, le=1e5)] = 0.0
    bearing_deg: Annotated[float, Meta(ge=-360.0, le=360.0)] = 0.0
    north_m: Annotated[float, Meta(ge=-1e4, le=1e4)] = 0.0
    east_m: Annotated[float, Meta(ge=-1e4, le=1e4)] = 0.0


class Me(msgspec.Struct, omit_defaults=True):
    """Which incident and post this is, and who one is, if one has signed in.

    ``review``: it is past, and there is nothing to be done. ``teams`` are who is of which.
    """

    incident: NodeId
    post: NodeId
    name: NodeId | None = None
    role: Role | None = None
    token: str | None = None
    review: bool = False
    teams: Crews = {}


class SignedIn(msgspec.Struct, omit_defaults=True):
    """As whom somebody has signed in; neither where nobody needs to."""

    name: NodeId | None = None
    role: Role | None = None


class Nothing(msgspec.Struct):
    """Nothing further to tell."""


class Sent(msgspec.Struct):
    """Who goes, and the way they go."""

    who: NodeId
    way: Way


class Asked(msgspec.Struct):
    """In whose name the post was asked for something, and under what number."""

    by: NodeId
    sequence: int


class Refusal(msgspec.Struct):
    """Why something was not done."""

    error: str


class Call(NamedTuple):
    """One thing that can be asked for; whoever has ``role`` may, anybody if that is ``None``.

    ``takes`` is the body, ``asks`` what stands after the path's question mark; ``gives`` the
    answer, as one of ``media_types``. ``name`` is the method that does it. ``refuses`` are the
    statuses beside those that ``role`` and ``takes`` bring with them.
    """

    name: str
    method: Literal["GET", "POST"]
    path: str
    says: str
    role: Role | None
    gives: Any
    takes: type[msgspec.Struct] | None = None
    status: HTTPStatus = HTTPStatus.OK
    media_types: tuple[str, ...] = ("application/json",)
    refuses: tuple[HTTPStatus, ...] = ()
    asks: Mapping[str, Any] = MappingProxyType({})


PARAMETERS: dict[str, Any] = {
    "responder_id": NodeId, "number": Sequence, "ending": Literal["csv", "geojson", "kml", "html"],
}  # fmt: skip
"""What a name in a path is."""

_ACCEPTED, _MISSING = HTTPStatus.ACCEPTED, HTTPStatus.NOT_FOUND

CALLS: tuple[Call, ...] = (
    Call("openapi", "GET", "/openapi.json", "This document.", None, dict[str, Any]),
    Call("me", "GET", "/me", "Which incident this is, and who one is.", None, Me),
    Call("sign_in", "POST", "/sign-in", "Begin a session.", None, SignedIn, SignIn,
         refuses=(HTTPStatus.FORBIDDEN,)),
    Call("sign_out", "POST", "/sign-out", "End the session.", "viewer", Nothing),
    Call("state", "GET", "/state", "All there is to see.", "viewer", Changes),
    Call("features", "GET", "/features.geojson", "Who and what is where on the Earth.", "viewer",
         dict[str, Any], media_types=("application/geo+json",), refuses=(_MISSING,)),
    Call("way_out", "GET", "/ways/out/{responder_id}", "The way out that was walked.", "viewer",
         Sent, refuses=(_MISSING,)),
    Call("rescue", "GET", "/ways/rescue/{responder_id}", "Who is soonest there, and how.", "viewer",
         Sent, refuses=(_MISSING,)),
    Call("plan", "GET", "/plan", "The building's walls, and where images of it lie.", "viewer",
         PlanView),
    Call("plan_image", "GET", "/plan/{number}", "An image of a storey.", "viewer", str,
         media_types=("image/png",), refuses=(_MISSING,)),
    Call("events", "GET", "/events", "What has changed, as it does: server-sent events.", "viewer",
         str, media_types=("text/event-stream",)),
    Call("order", "POST", "/orders", "Order somebody to do something.", "commander", Asked,
         OrderBody, _ACCEPTED),
    Call("alert", "POST", "/alerts/{number}", "Deal with an alert.", "operator", Asked,
         AlertBody, _ACCEPTED, refuses=(_MISSING,)),
    Call("set_origin", "POST", "/origin", "Say where on the Earth the incident is.", "commander",
         Asked, OriginBody, _ACCEPTED),
    Call("click", "POST", "/clicks", "Say where somebody is.", "commander", Asked, ClickBody,
         _ACCEPTED),
)  # fmt: skip
