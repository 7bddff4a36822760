"""Serves the page until the post stops: to this machine, or encrypted to those who sign in."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from command_post.gateways.at_work import at_work
from command_post.listening import Address, listening_address
from command_post.nodes.teams import Crews
from command_post.plans.plan_images import Plan
from command_post.web.page_process import PageProcess
from command_post.web.people import LOCAL_NAME, Person, load_people
from command_post.web.pipe import Serving
from command_post.web.serving import LOCAL_NAMES, ServerKeys, listening_at, told_where
from shared.messages import NodeId
from shared.security.bundle import CERTIFICATE_FILE, KEY_FILE, Bundle


def page_address(text: str, bundle: Bundle | None, people: Path | None) -> Address:
    """Return the address in ``--page HOST:PORT``.

    Raises ``ValueError`` for a malformed one, and for one beyond this machine without keys to
    encrypt with and ``people`` who sign in.
    """
    address = listening_address("--page", text, "127.0.0.1:8080")
    if not address.is_local and (bundle is None or people is None):
        raise ValueError(
            f"--page {text!r}: beyond this machine the page is encrypted and people sign in; give "
            "--keys and --people as well, or use 127.0.0.1:PORT"
        )
    return address


@contextmanager
def page_served(
    address: Address | None,
    incident: NodeId,
    post_id: NodeId,
    bundle: Bundle | None,
    people: Path | None,
    plan: Plan = Plan(),  # noqa: B008 - it is immutable
    teams: Crews | None = None,
) -> Iterator[PageProcess | None]:
    """Serve a page at ``address`` until the block ends, and give it; ``None`` without an address.

    Raises ``OSError`` if nobody can listen there, ``ConfigError`` for people that cannot be read,
    and ``ValueError`` where one of them goes by the post's name, or for keys that cannot be used.
    """
    if address is None:
        yield None
        return
    named = None if people is None else named_people(people, post_id)
    keys = None if bundle is None or address.is_local else _keys(bundle)
    if keys is not None:
        keys.check()
    hosts = tuple(LOCAL_NAMES) if address.is_local else ()
    with listening_at(address) as listening:
        page = PageProcess(
            Serving(incident, post_id, listening.fileno(), hosts, keys, named, plan, teams or {})
        )
        told_where(listening, address, keys)
        with at_work(page, "page"):
            yield page


def _keys(bundle: Bundle) -> ServerKeys:
    return ServerKeys(bundle.path(CERTIFICATE_FILE), bundle.path(KEY_FILE))


def named_people(path: Path, post_id: NodeId) -> dict[NodeId, Person]:
    """Return who may sign in at the page of a post, by name.

    Raises ``ConfigError`` for a file that cannot be used, and ``ValueError`` for a name in it that
    nobody can have.
    """
    people = load_people(path).people
    for taken in (post_id, LOCAL_NAME):
        if taken in people:
            raise ValueError(f"{path}: {taken!r} is taken; give that person another name")
    return people
