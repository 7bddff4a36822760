"""Keeps a DAP's process small; to be imported before what logs.

``structlog`` takes up what it finds to colour tracebacks and follow greenlets, ``asyncio`` and
what makes digests the system's OpenSSL: 9 MB that a box without a terminal, whose links Zenoh
encrypts, has no use for. Whoever needs any of it later imports it all the same; only ``hashlib``
is left with Python's own code, which makes the same digests.
"""

from __future__ import annotations

import sys
from importlib.util import find_spec
from types import ModuleType

SPARED = ("rich", "greenlet", "ssl")

if "structlog" not in sys.modules:
    known: dict[str, ModuleType | None] = sys.modules  # type: ignore[assignment]
    digests_itself = all(map(find_spec, ("_md5", "_sha1", "_sha3", "_blake2")))
    names = (*SPARED, "_hashlib") if digests_itself else SPARED
    spared = [name for name in names if name not in known]
    for name in spared:
        # This is how the import system is told that there is no such module.
        known[name] = None
    import hashlib  # noqa: F401
    import hmac  # noqa: F401

    import structlog  # noqa: F401

    for name in spared:
        del known[name]
