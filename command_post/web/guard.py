"""What every answer of the page says, and whom it is not given to.

A page elsewhere must not talk to the post through the browser of somebody who is signed in: the
name that was asked for must be one of ours, and whatever changes anything must come from our page.
"""

from __future__ import annotations

from collections.abc import Collection
from http import HTTPStatus
from urllib.parse import urlsplit

from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import PlainTextResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

HEADERS = {
    "Content-Security-Policy": "default-src 'self'; img-src 'self' data:; "
    "style-src 'self' 'unsafe-inline'; frame-ancestors 'none'; base-uri 'none'; form-action 'self'",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
}


class Guard:
    """Turns strangers' requests away before anybody looks at them, and marks all answers."""

    def __init__(self, app: ASGIApp, hosts: Collection[str]) -> None:
        """``hosts``: the names (without ports) that the page goes by; empty for any."""
        self._app = app
        self._hosts = hosts

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer, or let it be answered."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return

        async def send_marked(message: Message) -> None:
            if message["type"] == "http.response.start":
                MutableHeaders(scope=message).update(HEADERS)
            await send(message)

        why = self._stranger(scope)
        if why is not None:
            refusal = PlainTextResponse(why, HTTPStatus.FORBIDDEN)
            await refusal(scope, receive, send_marked)
            return
        await self._app(scope, receive, send_marked)

    def _stranger(self, scope: Scope) -> str | None:
        """Say why a request is none of ours, if it is not."""
        headers = Headers(scope=scope)
        asked = headers.get("host", "")
        if self._hosts and (urlsplit(f"//{asked}").hostname or "") not in self._hosts:
            return "this page does not go by that name"
        origin = headers.get("origin")
        reads = scope["method"] in ("GET", "HEAD") or origin is None
        return None if reads or urlsplit(origin).netloc == asked else "asked from another page"
