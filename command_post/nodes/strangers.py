"""What the post's own gate and links notice of strangers, as messages of its record (pure)."""

from __future__ import annotations

from command_post.incident import Incident
from shared.codec import encode
from shared.messages import StrangerNoticed
from shared.strangers import AtLinks, Noticed
from shared.topics import Key, Role

GATE_ID = "gate"
"""Under whose name the post's own gate reports."""


def stranger_message(noticed: Noticed, incident: Incident, now_ns: int) -> tuple[str, bytes]:
    """Return what was noticed at ``now_ns`` as a message under its key."""
    node_id = noticed.node_id or f"link-{noticed.why}"
    nodes: tuple[Role, ...] = ("responder", "dap")
    role: Role = next((each for each in nodes if (each, node_id) in incident.heard_ns), "post")
    key = Key(incident.settings.incident, "post", GATE_ID, "stranger")
    message = StrangerNoticed(
        event_time_ns=now_ns, sequence=0, role=role, node_id=node_id, words=noticed.words
    )
    return str(key), encode(message)


def twin_remarks(at_links: AtLinks, incident: Incident) -> list[str]:
    """Return that another post goes by this one's id, if DAPs hand on what it says.

    A router lets nobody pose as itself, so that none of it is heard.
    """
    post_id = incident.settings.post_id
    by = sorted(
        sender_id
        for sender_id, named in list(at_links.breaches)
        if named == post_id and ("dap", sender_id) in incident.heard_ns
    )
    return [f"another post goes by {post_id} too, in reach of {', '.join(by)}: end one"] * bool(by)
