"""Keeps a DAP's process small; to be imported before what logs.

``structlog`` takes up what it finds to colour tracebacks and follow greenlets, ``asyncio`` for
methods that nobody here calls, and ``asyncio`` and what makes digests the system's OpenSSL: 11 MB
that a box without a terminal, whose links Zenoh encrypts, has no use for. Whoever needs any of it
later imports it all the same; only ``hashlib`` is left with Python's own code, which makes the
same digests, and ``structlog`` without its asynchronous methods.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from types import ModuleType


@contextmanager
def doing_without(*names: str, taking: ModuleType | None = None) -> Iterator[None]:
    """Within the block modules of these ``names`` that are not loaded yet seem not to be there.

    Where what is imported takes one to be there, ``taking`` has its name and is taken for it.
    """
    known: dict[str, ModuleType | None] = sys.modules  # type: ignore[assignment]
    # None is how the import system is told that there is no such module.
    instead: dict[str, ModuleType | None] = dict.fromkeys(names)
    if taking is not None:
        instead[taking.__name__] = taking
    spared = {name: module for name, module in instead.items() if name not in known}
    known.update(spared)
    try:
        yield
    finally:
        for name in spared:
            del known[name]


if "structlog" not in sys.modules:
    digests_itself = all(map(find_spec, ("_md5", "_sha1", "_sha3", "_blake2")))
    others = ("_hashlib",) if digests_itself else ()
    with doing_without("rich", "greenlet", "ssl", *others, taking=ModuleType("asyncio")):
        import hashlib  # noqa: F401
        import hmac  # noqa: F401

        import structlog  # noqa: F401
