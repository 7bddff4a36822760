"""TOML files to frozen settings, strictly: whoever mistypes a key is told so, and what was meant.

Settings are msgspec structs declared with ``frozen=True, forbid_unknown_fields=True``; bounds
stand in their types (``msgspec.Meta``) and rules between fields in ``__post_init__``, which
raises ``ValueError``.
"""

from __future__ import annotations

import copy
import math
import re
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

import msgspec
from msgspec import inspect

T = TypeVar("T")
S = TypeVar("S", bound=msgspec.Struct)

_PATH_STEP = re.compile(r"([^.\[\]]+)(?![^\[]*\])|\[(\d+)\]")


class ConfigError(ValueError):
    """A settings file cannot be used. The text names the file, the key, and what to do."""


def load_toml(path: Path, kind: type[T]) -> T:
    """Return the settings of type ``kind`` that the TOML file at ``path`` holds.

    Raises ``ConfigError`` when the file cannot be read or is not TOML, and for an unknown key, a
    missing one, a value of the wrong type or out of bounds, or one that is not a finite number.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise ConfigError(f"{path}: no such file; give the path of a TOML file") from None
    except UnicodeDecodeError as error:
        raise ConfigError(f"{path}: not text ({error}); save it as UTF-8") from None
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read ({error.strerror}); give another") from None
    return parse_toml(text, kind, str(path))


def parse_toml(text: str, kind: type[T], origin: str) -> T:
    """Return the settings in ``text``; errors are as in ``load_toml`` and name ``origin``."""
    try:
        values = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        end = f"line {text.count(chr(10)) + 1}, the end"
        what = str(error).replace("end of document", end)
        raise ConfigError(f"{origin}: not valid TOML: {what}; correct it there") from None
    for complaint in _complaints(values, inspect.type_info(kind), ""):
        raise ConfigError(f"{origin}: {complaint}")
    try:
        return msgspec.convert(values, kind)
    except msgspec.ValidationError as error:
        complaint = _naming_entries(str(error), values, kind)
        raise ConfigError(f"{origin}: {_told_by_key(complaint)}") from None


def checked(settings: S) -> S:
    """Return ``settings``, made in code or of a command line's arguments, if all are in bounds.

    Structs check themselves only when they are decoded. Raises ``ConfigError``.
    """
    try:
        return msgspec.convert(msgspec.to_builtins(settings), type(settings))
    except msgspec.ValidationError as error:
        raise ConfigError(_told_by_key(str(error))) from None


def _complaints(value: object, expected: inspect.Type, place: str) -> Iterator[str]:
    """Say what msgspec would pass over or say without help, depth first."""
    if isinstance(value, float) and not math.isfinite(value):
        yield f"{place}: {value} is not a finite number; give one"
    elif isinstance(value, Mapping):
        for key, entry in value.items():
            here = f"{place}.{key}" if place else key
            inner = _type_under(expected, key, value)
            if inner is None:
                yield f"{here}: unknown key; {_advice(key, _fields(expected, value))}"
            else:
                yield from _complaints(entry, inner, here)
    elif isinstance(value, Sequence) and not isinstance(value, str):
        for index, entry in enumerate(value):
            yield from _complaints(entry, _item_type(expected, index), f"{place}[{index}]")


def _type_under(
    expected: inspect.Type, key: str, value: Mapping[str, object]
) -> inspect.Type | None:
    """Return the type that ``key`` must have in ``value``; ``None`` if it may not be there."""
    struct = _struct(expected, value)
    if struct is not None:
        return _fields(struct, value).get(key)
    tables = [option for option in _options(expected) if isinstance(option, inspect.DictType)]
    return tables[0].value_type if tables else inspect.AnyType()


def _fields(expected: inspect.Type, value: Mapping[str, object]) -> dict[str, inspect.Type]:
    """Return the keys that ``expected`` allows in ``value``, with their types."""
    struct = _struct(expected, value)
    if struct is None:
        return {}
    fields = {field.encode_name: field.type for field in struct.fields}
    return fields if struct.tag_field is None else {struct.tag_field: inspect.AnyType(), **fields}


def _struct(expected: inspect.Type, value: Mapping[str, object]) -> inspect.StructType | None:
    """Return the struct that ``value`` is to become: of a tagged union, the one it names."""
    structs = [option for option in _options(expected) if isinstance(option, inspect.StructType)]
    if len(structs) == 1:
        return structs[0]
    return next((s for s in structs if value.get(s.tag_field or "") == s.tag), None)


def _item_type(expected: inspect.Type, index: int) -> inspect.Type:
    for option in _options(expected):
        if isinstance(option, inspect.TupleType) and index < len(option.item_types):
            return option.item_types[index]
        if isinstance(option, inspect.CollectionType):
            return option.item_type
    return inspect.AnyType()


def _options(expected: inspect.Type) -> tuple[inspect.Type, ...]:
    """Return the types a union allows; of metadata around a type, the type."""
    if isinstance(expected, inspect.Metadata):
        return _options(expected.type)
    return tuple(expected.types) if isinstance(expected, inspect.UnionType) else (expected,)


def _advice(key: str, allowed: Mapping[str, inspect.Type]) -> str:
    # A node at work whose settings are right has no room for it.
    from difflib import get_close_matches  # noqa: PLC0415

    close = get_close_matches(key, allowed, n=1)
    return f"did you mean {close[0]!r}?" if close else f"remove it, or use {', '.join(allowed)}"


def _naming_entries(complaint: str, values: dict[str, Any], kind: type[Any]) -> str:
    """Put the key where msgspec, speaking of a table with free keys, says only ``[...]``.

    It is the key whose entry alone is enough for the same complaint.
    """
    before, unnamed, _ = complaint.partition("[...]")
    if not unnamed:
        return complaint
    values = copy.deepcopy(values)
    table: Any = values
    for name, index in _PATH_STEP.findall(before.rpartition("`$")[2]):
        table = table[name] if name else table[int(index)]
    entries = dict(table)
    for key, entry in entries.items():
        table.clear()
        table[key] = entry
        try:
            msgspec.convert(values, kind)
        except msgspec.ValidationError as error:
            if str(error) == complaint:
                return complaint.replace("[...]", f".{key}", 1)
    return complaint


def _told_by_key(complaint: str) -> str:
    """Turn msgspec's ``what - at `$.place``` about, so that the key comes first."""
    what, _, place = complaint.rpartition(" - at `$")
    what, place = (what, place.rstrip("`").lstrip(".")) if what else (complaint, "")
    missing = "Object missing required field `"
    if what.startswith(missing):
        key = what.removeprefix(missing).rstrip("`")
        return f"{place}.{key}: missing; add it" if place else f"{key}: missing; add it"
    return f"{place}: {what}; correct it" if place else f"{what}; correct it"
