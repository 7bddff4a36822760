"""The one table of what a recording's page does over HTTP, as ``command_post.web.calls`` has it."""

from __future__ import annotations

from http import HTTPStatus
from typing import Any

import msgspec

from command_post.exports.endings import FORMATS
from command_post.plans.plan_view import PlanView
from command_post.review.timeline import Timeline
from command_post.review.wishes import Compared, Wish
from command_post.web.board import Changes
from command_post.web.calls import Call, Me, Nothing, Sent


class Comparing(msgspec.Struct, frozen=True):
    """What there is to compare with, and how far the newest wish is: ``share`` of 1.

    ``failed`` says why nothing comes of it.
    """

    plan: bool
    settings: bool
    wish: Wish | None
    share: float
    failed: str | None
    is_done: bool


_BAD, _MISSING = HTTPStatus.BAD_REQUEST, HTTPStatus.NOT_FOUND
_CONFLICT, _OVER = HTTPStatus.CONFLICT, HTTPStatus.SERVICE_UNAVAILABLE

REVIEW_CALLS: tuple[Call, ...] = (
    Call("openapi", "GET", "/openapi.json", "This document.", None, dict[str, Any]),
    Call("me", "GET", "/me", "Which incident this was.", None, Me),
    Call("timeline", "GET", "/timeline", "What was alerted to and ordered, when; and what is not in"
         " the record.", None, Timeline),
    Call("moment", "GET", "/moment", "All that was shown so many seconds after the beginning.",
         None, Changes, refuses=(_BAD, _OVER), asks={"at_s": float}),
    Call("moments", "GET", "/moments", "What changed in each of so many steps from there on.", None,
         list[Changes], refuses=(_BAD, _OVER),
         asks={"after_s": float, "step_s": float, "count": int}),
    Call("way_out", "GET", "/ways/out/{responder_id}", "The way out that had been walked then.",
         None, Sent, refuses=(_BAD, _MISSING, _OVER), asks={"at_s": float}),
    Call("rescue", "GET", "/ways/rescue/{responder_id}", "Who was soonest there then, and how.",
         None, Sent, refuses=(_BAD, _MISSING, _OVER), asks={"at_s": float}),
    Call("plan", "GET", "/plan", "The building's walls, and where images of it lie.", None,
         PlanView),
    Call("plan_image", "GET", "/plan/{number}", "An image of a storey.", None, str,
         media_types=("image/png",), refuses=(_MISSING,)),
    Call("comparison", "GET", "/comparison", "What to compare with, and how far that is.", None,
         Comparing),
    Call("compare", "POST", "/comparison", "Begin a comparison.", "viewer", Nothing, Wish,
         HTTPStatus.ACCEPTED, refuses=(_CONFLICT,)),
    Call("compared", "GET", "/comparison/result", "The other ways, and how far off they are.", None,
         Compared, refuses=(_MISSING,)),
    Call("export", "GET", "/export/incident.{ending}", "The recording in another format.", None,
         str | dict[str, Any], media_types=tuple(FORMATS.values()), refuses=(_MISSING, _CONFLICT)),
)  # fmt: skip
