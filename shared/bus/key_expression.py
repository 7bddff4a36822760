"""Which keys a key expression speaks of: ``*`` is one chunk, ``**`` any number, also none.

As Zenoh has it, without its ``$*``: a chunk that begins with ``@`` is spoken of by name only.
"""

from __future__ import annotations

import re
from functools import lru_cache

_CHUNK = r"[^/*$#?]+"
_KEY = re.compile(rf"{_CHUNK}(?:/{_CHUNK})*")
_EXPRESSION = re.compile(rf"(?:{_CHUNK}|\*\*?)(?:/(?:{_CHUNK}|\*\*?))*")
_ONE = r"/[^/@][^/]*"


def check_key(key: str) -> str:
    """Return ``key`` if messages can be sent under it, else raise ``ValueError``."""
    if not _KEY.fullmatch(key):
        raise ValueError(f"key {key!r}: use chunks between single '/', without any of * $ # ?")
    return key


def check_key_expression(expression: str) -> str:
    """Return ``expression`` if it is one, in its shortest form, else raise ``ValueError``."""
    if not _EXPRESSION.fullmatch(expression):
        raise ValueError(
            f"key expression {expression!r}: use chunks between single '/', '*' for one, "
            "'**' for any number, without any of $ # ?"
        )
    if "**/*" in expression:
        raise ValueError(f"key expression {expression!r}: write '**/**' as '**', '**/*' as '*/**'")
    return expression


def matches(expression: str, key: str) -> bool:
    """Return whether ``expression`` speaks of ``key``. Both are taken to be well-formed."""
    return _pattern(expression).fullmatch(f"/{key}") is not None


@lru_cache(maxsize=1024)
def _pattern(expression: str) -> re.Pattern[str]:
    wild = {"*": _ONE, "**": f"(?:{_ONE})*"}
    return re.compile(
        "".join(wild.get(chunk, re.escape(f"/{chunk}")) for chunk in expression.split("/"))
    )
