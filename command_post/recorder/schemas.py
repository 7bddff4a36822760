"""What each message decodes to, for whoever reads a recording without us: as JSON Schema (pure)."""

from __future__ import annotations

import msgspec

from shared.messages import Message
from shared.topics import TOPICS

MESSAGES = {topic.message.__name__: topic.message for topic in TOPICS.values()}


def json_schema(message: type[Message]) -> bytes:
    """Return the JSON Schema of what ``message`` decodes to: one object, self-contained."""
    _, parts = msgspec.json.schema_components([message], ref_template="#/$defs/{name}")
    root = parts.pop(message.__name__)
    dialect = "https://json-schema.org/draft/2020-12/schema"
    return msgspec.json.encode({"$schema": dialect, **root, "$defs": parts}, order="sorted")
