"""Whom a running post lets look in, and talks to: its page, a TAK server, and Foxglove."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import structlog
from cyclopts import Parameter

from command_post.gateways.foxglove_live import foxglove_address, foxglove_served
from command_post.gateways.tak import TakServer, checked_server, linked_to_tak
from command_post.going_on import Guest
from command_post.listening import Address
from command_post.nodes.teams import Crews
from command_post.plans.plan_images import load_plan
from command_post.starting_origin import StartingOrigin
from command_post.web.server import named_people, page_address, page_served
from shared.geodesy import Origin, parse_origin
from shared.messages import NodeId
from shared.security.bundle import Bundle

_log = structlog.stdlib.get_logger(__name__)


@Parameter(name="*")
@dataclass(frozen=True)
class Doors:
    """The options of ``command-post run`` for those who look in.

    Attributes
    ----------
    page
        HOST:PORT where people see the incident in a browser, as in 127.0.0.1:8080.
    people
        File of those who may sign in at the page ('command-post people' makes it). Without one
        the page is for this machine alone, and whoever sits there commands.
    plan_image
        A storey's plan (PNG) to draw in the page: FILE[@HEIGHT], placed by its world file of metres
        east and north (FILE.pgw), or FILE[@HEIGHT];X,Y=NORTH,EAST;X,Y=NORTH,EAST by two points.
        One an option, for as many storeys as there are.
    origin
        Where the incident's origin is: LATITUDE,LONGITUDE[,HEIGHT[,BEARING]], degrees and metres
        above the ellipsoid; BEARING is how far its north is clockwise of true north. What people
        have set since counts more.
    tak
        A TAK server to tell, and to hear: tcp://HOST:PORT or tls://HOST:PORT.
    tak_cert
        This post's certificate for the TAK server (PEM).
    tak_key
        Its private key (PEM).
    tak_ca
        The TAK server's authority (PEM).
    foxglove
        HOST:PORT of this machine where Foxglove or Lichtblick finds the incident, as in
        127.0.0.1:8765.

    """

    page: str | None = None
    people: Path | None = None
    plan_image: Annotated[tuple[str, ...], Parameter(consume_multiple=False)] = ()
    origin: str | None = None
    tak: str | None = None
    tak_cert: Path | None = None
    tak_key: Path | None = None
    tak_ca: Path | None = None
    foxglove: str | None = None

    def check(self, bundle: Bundle | None, post_id: NodeId) -> None:
        """Raise ``ValueError`` for options that cannot be used, before anything is begun."""
        self._address(bundle)
        if self.people is not None:
            named_people(self.people, post_id)
        load_plan(None, self.plan_image)
        self._foxglove_address()
        if self._server is not None and self.place is None:
            _log.warning("TAK is told nothing until somebody sets the incident's origin")

    @contextmanager
    def opened(
        self,
        incident: NodeId,
        post_id: NodeId,
        bundle: Bundle | None,
        plan: Path | None = None,
        teams: Crews | None = None,
    ) -> Iterator[tuple[Guest, ...]]:
        """Give who is to be told of what the post says, and hear them, until the block ends.

        The page draws the walls in ``plan``, where it can be used, and orders ``teams`` at once.

        Raises ``ValueError`` for options that cannot be used, ``OSError`` where nobody can listen.
        """
        address, place = self._address(bundle), self.place
        drawn = load_plan(plan, self.plan_image)
        with (
            page_served(address, incident, post_id, bundle, self.people, drawn, teams) as page,
            linked_to_tak(self._server, incident, place) as link,
            foxglove_served(self._foxglove_address(), incident, place) as door,
        ):
            said = None if place is None else StartingOrigin(incident, place)
            yield tuple(guest for guest in (page, link, door, said) if guest is not None)

    def _address(self, bundle: Bundle | None) -> Address | None:
        return None if self.page is None else page_address(self.page, bundle, self.people)

    def _foxglove_address(self) -> Address | None:
        return None if self.foxglove is None else foxglove_address(self.foxglove)

    @property
    def place(self) -> Origin | None:
        """Where the incident is, if that is known. Raises ``ValueError`` for one that is none."""
        return None if self.origin is None else parse_origin(self.origin)

    @property
    def _server(self) -> TakServer | None:
        if self.tak is None:
            if (self.tak_cert, self.tak_key, self.tak_ca) != (None, None, None):
                raise ValueError("--tak-cert, --tak-key and --tak-ca are for --tak; give that too")
            return None
        return checked_server(TakServer(self.tak, self.tak_cert, self.tak_key, self.tak_ca))
