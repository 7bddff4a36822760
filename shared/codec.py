"""Bytes to message and back, strictly.

Bad input is expected on a radio network, so ``decode`` returns a ``Refusal`` for it and never
raises: whoever receives it counts it, keeps the bytes as evidence, and goes on.
"""

from __future__ import annotations

from typing import Literal, NamedTuple, TypeAlias

import msgspec

from shared.messages import Message
from shared.topics import _ID, ROLES, TOPICS, WIRE_VERSION, Key

MAX_PAYLOAD_BYTES = 65_536

RefusalReason: TypeAlias = Literal[
    "unknown_version", "unknown_key", "too_large", "not_messagepack", "invalid"
]


class Refusal(NamedTuple):
    """Why bytes under a key are not a message: the kind, to count by, and the words."""

    reason: RefusalReason
    detail: str


_encoder = msgspec.msgpack.Encoder()
_decoders = {name: msgspec.msgpack.Decoder(topic.message) for name, topic in TOPICS.items()}


def encode(message: Message) -> bytes:
    """Return ``message`` as a MessagePack map."""
    return _encoder.encode(message)


def parse_key(key: str) -> Key | Refusal:
    """Take a key apart, or say why it is not one of ours."""
    chunks = key.split("/")
    if len(chunks) != 6 or chunks[0] != "clew":
        return Refusal("unknown_key", f"not clew/{WIRE_VERSION}/incident/role/id/topic: {key!r}")
    _, version, incident, role_chunk, node_id, topic = chunks
    if version != WIRE_VERSION:
        return Refusal("unknown_version", f"{version!r}, this program speaks {WIRE_VERSION}")
    role = next((known for known in ROLES if known == role_chunk), None)
    if role is None or topic not in TOPICS or role not in TOPICS[topic].roles:
        return Refusal("unknown_key", f"no topic {topic!r} of a {role_chunk!r}")
    if not (_ID.fullmatch(incident) and _ID.fullmatch(node_id)):
        return Refusal("unknown_key", f"incident {incident!r} or id {node_id!r} malformed")
    return Key(incident, role, node_id, topic)


def decode(key: Key, payload: bytes) -> Message | Refusal:
    """Return the message that ``payload`` holds under ``key``, or why it is refused."""
    if len(payload) > MAX_PAYLOAD_BYTES:
        return Refusal("too_large", f"{len(payload)} bytes, the limit is {MAX_PAYLOAD_BYTES}")
    try:
        return _decoders[key.topic].decode(payload)
    except msgspec.ValidationError as error:
        return Refusal("invalid", str(error))
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError, ValueError) as error:
        return Refusal("not_messagepack", str(error))


def message_of(key: str, payload: bytes) -> Message | Refusal:
    """Return the message that ``payload`` holds under the text of a key, or why it is refused."""
    parsed = parse_key(key)
    return parsed if isinstance(parsed, Refusal) else decode(parsed, payload)
