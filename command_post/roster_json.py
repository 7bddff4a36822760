"""The roster for programs (pure)."""

from __future__ import annotations

import msgspec

from command_post.roster import Roster


def roster_json(roster: Roster) -> bytes:
    """Return the roster as one JSON object: its fields, and the words that the table has."""
    return msgspec.json.encode(
        {
            "now_ns": roster.now_ns,
            "remarks": roster.remarks,
            "responders": [
                {**row._asdict(), "orders": [one._asdict() for one in row.orders]}
                for row in roster.responders
            ],
            "daps": [row._asdict() for row in roster.daps],
            "nodes": [
                {**node._asdict(), "silence": node.silence, "words": node.words}
                for node in roster.nodes
            ],
        }
    )
