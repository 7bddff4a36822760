"""The roster for programs (pure)."""

from __future__ import annotations

from types import GenericAlias
from typing import Any, get_type_hints

import msgspec

from command_post.nodes.freshness import Freshness
from command_post.roster import DapRow, OrderedRow, ResponderRow, Roster


def _as_object(name: str, row: type, **others: Any) -> Any:
    """Return the type of an object of a row's fields; ``others`` come in their place or besides."""
    return msgspec.defstruct(name, list({**get_type_hints(row), **others}.items()))


def _rows_of(kind: Any) -> Any:
    return GenericAlias(tuple, (kind, ...))


_ORDERED = _as_object("OrderedRow", OrderedRow)
_RESPONDER = _as_object("ResponderRow", ResponderRow, orders=_rows_of(_ORDERED))
_NODE = _as_object("Freshness", Freshness, silence=str | None, words=tuple[str, ...])

ROSTER = _as_object(
    "Roster", Roster, responders=_rows_of(_RESPONDER),
    daps=_rows_of(_as_object("DapRow", DapRow)), nodes=_rows_of(_NODE),
)  # fmt: skip
"""The type of what ``roster_json`` returns."""


def roster_json(roster: Roster) -> bytes:
    """Return the roster as one JSON object: its fields, and the words that the table has."""
    return msgspec.json.encode(
        {
            "now_ns": roster.now_ns,
            "responders": [
                {**row._asdict(), "orders": [one._asdict() for one in row.orders]}
                for row in roster.responders
            ],
            "daps": [row._asdict() for row in roster.daps],
            "nodes": [
                {**node._asdict(), "silence": node.silence, "words": node.words}
                for node in roster.nodes
            ],
            "remarks": roster.remarks,
        }
    )
