"""Options that the command lines of all nodes have alike.

They stand apart from what they lead to, so that a node at work need not load what reads options.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, TypeAlias

from cyclopts import Parameter

Keys: TypeAlias = Annotated[Path | None, Parameter(name="--keys")]
Insecure: TypeAlias = Annotated[bool, Parameter(name="--insecure", negative="")]
JournalFile: TypeAlias = Annotated[Path | None, Parameter(name="--journal")]
