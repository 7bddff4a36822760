"""Who may say what to whom, at a router: made from the topic table, default deny (pure).

A responder may put, answer and hold tokens under its own keys only, and hear and ask only what is
meant for it. Posts and DAPs hand on what others say, so what they may pass is not narrowed, save
that nobody may pose as the router itself. What a relay forges is found by its signature.

Nodes are told apart by their certificates' common names, which Zenoh compares letter by letter,
and reads once when it starts: a node that is named later is mute at a router that has not been
told of it.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from shared.security.certificates import Identity
from shared.topics import TOPICS, WIRE_VERSION, Role

ANSWERED: dict[str, tuple[Role, ...]] = {
    "journal": ("responder", "dap", "post"),
    "certificate": ("responder", "dap", "post"),
    "time": ("post",),
}
"""What is asked for and is no topic, and who answers."""

TOKENS: dict[str, tuple[Role, ...]] = {
    "alive": ("responder", "dap", "post"),
    "finished": ("responder",),
}
"""The liveliness tokens, and who holds them."""

MEANT_FOR_RESPONDERS = (
    "order", "mayday_answer", "receipt", "exercise", "beat", "stations", "site", *ANSWERED, "alive",
)  # fmt: skip
"""What a responder hears and asks of posts."""

_SAYS = ["put", "reply", "declare_queryable", "liveliness_token"]
_ASKS = ["query", "declare_subscriber", "declare_liveliness_subscriber", "liveliness_query"]
_HEARS = ["put", "reply", "liveliness_token"]
_OF_OTHERS = ["query", "declare_subscriber", "declare_queryable",
              "declare_liveliness_subscriber", "liveliness_query"]  # fmt: skip
_ALL = sorted({*_SAYS, *_ASKS})

_EVERYTHING = "clew/**"
_MEANT, _OF_OTHERS_TO_ALL, _PASSING, _POSING = "meant", "of others", "passing", "posing"


def ends_of(role: Role) -> list[str]:
    """Return the last parts of all keys that a node of ``role`` speaks under."""
    topics = [topic.name for topic in TOPICS.values() if role in topic.roles]
    others = [name for table in (ANSWERED, TOKENS) for name, by in table.items() if role in by]
    return topics + others


def access_control(router: Identity, nodes: Iterable[Identity]) -> dict[str, Any]:
    """Return Zenoh's settings of who among ``nodes`` may say and hear what at ``router``."""
    named = sorted(set(nodes) - {router})
    responders = [node for node in named if node.role == "responder"]
    relays = [node for node in named if node.role != "responder"]
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": [
            _rule(_MEANT, _ASKS, "ingress", _of("post", "*", MEANT_FOR_RESPONDERS)),
            _rule(f"{_MEANT}, back", _HEARS, "egress", _of("post", "*", MEANT_FOR_RESPONDERS)),
            # Told widely: an asker's wildcard passes only where all that it means is allowed.
            _rule(_OF_OTHERS_TO_ALL, _OF_OTHERS, "egress", [_EVERYTHING]),
            _rule(_PASSING, _ALL, None, [_EVERYTHING]),
            _rule(_POSING, _SAYS, "ingress", [_own_keys(router)], "deny"),
            *(_rule(_own(node), _SAYS, "ingress", _own_ends(node)) for node in responders),
        ],
        "subjects": [
            {"id": node.node_id, "cert_common_names": [node.node_id]} for node in named
        ],
        "policies": [
            *(
                _policy([_own(node), _MEANT, f"{_MEANT}, back", _OF_OTHERS_TO_ALL], node)
                for node in responders
            ),
            *(_policy([_PASSING, _POSING], node) for node in relays),
        ],
    }  # fmt: skip


def _rule(
    name: str,
    messages: list[str],
    flow: str | None,
    keys: list[str],
    permission: str = "allow",
) -> dict[str, Any]:
    return {
        "id": name,
        "messages": messages,
        "flows": ["ingress", "egress"] if flow is None else [flow],
        "permission": permission,
        "key_exprs": keys,
    }


def _policy(rules: list[str], node: Identity) -> dict[str, Any]:
    return {"rules": rules, "subjects": [node.node_id]}


def _own(node: Identity) -> str:
    return f"own keys of {node.node_id}"


def _own_ends(node: Identity) -> list[str]:
    return _of(node.role, node.node_id, ends_of(node.role))


def _own_keys(node: Identity) -> str:
    return f"clew/*/*/{node.role}/{node.node_id}/**"


def _of(role: Role, node_id: str, ends: Iterable[str]) -> list[str]:
    return [f"clew/{WIRE_VERSION}/*/{role}/{node_id}/{end}" for end in ends]
