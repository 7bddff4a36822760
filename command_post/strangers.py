"""Strangers at the gate (pure): who speaks in the name of a node without being it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal, TypeAlias

from command_post.incident import Incident
from shared.codec import encode
from shared.gate import Turned
from shared.messages import StrangerNoticed
from shared.topics import Key, Role, is_id

GATE_ID = "gate"
"""Under whose name the post's own gate reports."""

Strange: TypeAlias = Turned | Literal["breach"]
"""Why somebody is a stranger: for the gate's reasons, or turned away by a router's access rules."""

WORDS: dict[Strange, str] = {
    "forged": "that it has not signed",
    "unsigned": "without a signature",
    "unsealed": "without a signature",
    "withdrawn": "with a withdrawn key",
    "breach": "that are not its own to send",
}


class Strangers:
    """Notices each kind of stranger once for each node that they name."""

    def __init__(self) -> None:
        self._noticed: set[tuple[Strange, str]] = set()

    def noticed(
        self,
        turned: Mapping[tuple[Turned, str], int],
        breaches: Mapping[str, int],
        incident: Incident,
        now_ns: int,
    ) -> list[tuple[str, bytes]]:
        """Return what is new among what was ``turned`` away, as messages under their keys.

        ``breaches`` are what access rules have refused, by the node that is named.
        """
        seen: list[tuple[Strange, str]] = [
            *(each for each in turned if each[0] in WORDS),
            *(("breach", named) for named in list(breaches) if is_id(named)),
        ]
        new = [each for each in seen if each not in self._noticed]
        self._noticed.update(new)
        return [_message(why, node_id, incident, now_ns) for why, node_id in new]


def _message(why: Strange, node_id: str, incident: Incident, now_ns: int) -> tuple[str, bytes]:
    role: Role = "dap" if ("dap", node_id) in incident.heard_ns else "responder"
    key = Key(incident.settings.incident, "post", GATE_ID, "stranger")
    noticed = StrangerNoticed(
        event_time_ns=now_ns, sequence=0, role=role, node_id=node_id,
        words=f"somebody sends messages {WORDS[why]}",
    )  # fmt: skip
    return str(key), encode(noticed)
