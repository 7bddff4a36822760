"""Any message of any topic, for Hypothesis: built from the types that the vocabulary declares."""

from __future__ import annotations

from functools import cache
from typing import Any

from hypothesis import strategies as st
from msgspec import inspect

from shared.messages import Message
from shared.topics import TOPICS, Key

INCIDENT = "incident-1"
NODE = "n_1"


def key_for(topic: str) -> Key:
    """Return a key under which the topic is sent."""
    return Key(INCIDENT, TOPICS[topic].roles[0], NODE, topic)


@cache
def messages(message: type[Message]) -> st.SearchStrategy[Message]:
    """Return a strategy for valid messages of this type, to the ends of every bound."""
    return _values(inspect.type_info(message))


def _values(kind: inspect.Type) -> st.SearchStrategy[Any]:
    match kind:
        case inspect.StructType():
            return st.builds(kind.cls, **{field.name: _values(field.type) for field in kind.fields})
        case inspect.UnionType():
            return st.one_of(*map(_values, kind.types))
        case inspect.TupleType():
            return st.tuples(*map(_values, kind.item_types))
        case inspect.VarTupleType():
            most = 9 if kind.max_length is None else min(kind.max_length, 9)
            return st.lists(_values(kind.item_type), max_size=most).map(tuple)
        case _:
            return _scalars(kind)


def _scalars(kind: inspect.Type) -> st.SearchStrategy[Any]:
    match kind:
        case inspect.IntType():
            return st.integers(kind.ge, kind.le)
        case inspect.FloatType():
            return st.floats(
                kind.ge if kind.gt is None else kind.gt,
                kind.le if kind.lt is None else kind.lt,
                exclude_min=kind.gt is not None,
                exclude_max=kind.lt is not None,
                allow_nan=False,
                allow_infinity=False,
            )
        case inspect.StrType(pattern=None):
            return st.text(min_size=kind.min_length or 0, max_size=kind.max_length)
        case inspect.StrType(pattern=str(pattern)):
            return st.from_regex(pattern, fullmatch=True)
        case inspect.LiteralType():
            return st.sampled_from(kind.values)
        case inspect.BoolType() | inspect.NoneType():
            return st.booleans() if isinstance(kind, inspect.BoolType) else st.none()
        case _:
            raise NotImplementedError(f"the vocabulary has no {kind} so far")
