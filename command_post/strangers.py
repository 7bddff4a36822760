"""Strangers (pure): who speaks in the name of a node without being it, and who wants a link."""

from __future__ import annotations

from collections.abc import Mapping

from command_post.incident import Incident
from shared.codec import encode
from shared.gate import Turned
from shared.messages import StrangerNoticed
from shared.topics import Key, Role

GATE_ID = "gate"
"""Under whose name the post's own gate reports."""

WORDS: dict[Turned, str] = {
    "forged": "that it has not signed",
    "unsigned": "without a signature",
    "unsealed": "without a signature",
    "withdrawn": "with a withdrawn key",
}

LINK_WORDS: dict[str, str] = {
    "no_certificate": "shows no certificate",
    "expired": "has a certificate that has expired",
    "not_yet_valid": "has a certificate that is not valid yet",
    "foreign": "has a certificate of another authority",
    "not_tls": "does not encrypt",
    "not_named": "has a certificate that nobody here knows of",
}
"""Why a link was refused, where that is worth an alert."""


class Strangers:
    """Notices each kind of stranger once for each node that they name."""

    def __init__(self) -> None:
        self._noticed: set[tuple[str, str]] = set()

    def noticed(
        self,
        turned: Mapping[tuple[Turned, str], int],
        refused_links: Mapping[str, int],
        incident: Incident,
        now_ns: int,
    ) -> list[tuple[str, bytes]]:
        """Return what is new among what was ``turned`` away, as messages under their keys.

        ``refused_links`` are the links that were refused, by why.
        """
        told: list[tuple[str, str, str]] = [
            (why, node_id, f"somebody sends messages {WORDS[why]}")
            for why, node_id in turned
            if why in WORDS
        ]
        told += [
            (why, f"link-{why}", f"a link was refused: who dials {LINK_WORDS[why]}")
            for why in list(refused_links)
            if why in LINK_WORDS
        ]
        new = [each for each in told if each[:2] not in self._noticed]
        self._noticed.update(each[:2] for each in new)
        return [_message(node_id, words, incident, now_ns) for _, node_id, words in new]


def _message(node_id: str, words: str, incident: Incident, now_ns: int) -> tuple[str, bytes]:
    nodes: tuple[Role, ...] = ("responder", "dap")
    role: Role = next((each for each in nodes if (each, node_id) in incident.heard_ns), "post")
    key = Key(incident.settings.incident, "post", GATE_ID, "stranger")
    noticed = StrangerNoticed(
        event_time_ns=now_ns, sequence=0, role=role, node_id=node_id, words=words
    )
    return str(key), encode(noticed)
