"""The mayday button on the phone's page: what is held there, and what its wearer is told."""

from __future__ import annotations

from starlette.requests import Request as HttpRequest
from starlette.responses import PlainTextResponse, Response
from starlette.routing import Route

from edge_agent.mayday_controls import COMMANDS, Request
from shared.bus.inbox import Inbox

MOST_WAITING = 16
MOST_BYTES = 64


class PhoneButton:
    """A control of the wearer's, by their phone; how their call stands is there to be asked for."""

    def __init__(self) -> None:
        self._wanted: Inbox[Request] = Inbox(MOST_WAITING)
        self._words = ""

    def requests(self, *, stands: bool) -> list[Request]:  # noqa: ARG002
        """Return what was wanted since."""
        return self._wanted.get_all()

    def tell(self, words: str) -> None:
        """Have the page show how the call stands."""
        self._words = words

    def close(self) -> None:
        """Pass: the page ends with its server."""

    def route(self, path: str) -> Route:
        """Return where the page asks, and says what is held."""
        return Route(path, self._answer, methods=["GET", "POST"])

    async def _answer(self, request: HttpRequest) -> Response:
        if request.method == "POST":
            said = b""
            async for part in request.stream():
                said += part
                if len(said) > MOST_BYTES:
                    break
            act = COMMANDS.get(said)
            if act is None:
                return PlainTextResponse("say call or cancel", 400)
            self._wanted.put(Request(act, "held on the phone"))
        return PlainTextResponse(self._words, headers={"Cache-Control": "no-store"})
