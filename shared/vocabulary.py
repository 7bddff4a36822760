"""``python -m shared.vocabulary``: all that is said, for who writes a program of their own."""

from __future__ import annotations

from typing import Annotated, Any

import cyclopts
import msgspec
from cyclopts import Parameter
from rich.console import Console
from rich.table import Table

from shared.topics import TOPICS


def vocabulary(*, schema: Annotated[bool, Parameter(negative="")] = False) -> None:
    """Print the table of topics: who says what, how often, how urgently, and what is kept of it.

    Parameters
    ----------
    schema
        Print the JSON Schema of every message instead, by topic, as MessagePack has it too.

    """
    if schema:
        print(msgspec.json.format(msgspec.json.encode(schemas())).decode())  # noqa: T201
        return
    table = Table("topic", "message", "said by", "a second", "priority", "recorded", "journalled")
    for topic in TOPICS.values():
        table.add_row(
            topic.name, topic.message.__name__, ", ".join(topic.roles),
            f"{topic.rate_hz:g}" if topic.rate_hz else "rarely", topic.priority,
            *("yes" if each else "no" for each in (topic.recorded, topic.journalled)),
        )  # fmt: skip
    Console(width=120).print(table)


def schemas() -> dict[str, Any]:
    """Return the JSON Schema of each topic's message, in one document that each refers to."""
    told, components = msgspec.json.schema_components(
        [topic.message for topic in TOPICS.values()], ref_template="#/$defs/{name}"
    )
    return {"topics": dict(zip(TOPICS, told, strict=True)), "$defs": components}


if __name__ == "__main__":
    cyclopts.run(vocabulary)
