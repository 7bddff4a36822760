"""Options that several command lines have alike.

They stand apart from what they lead to, so that a node at work need not load what reads options.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, TypeAlias

from cyclopts import Parameter
from cyclopts.validators import Number

Keys: TypeAlias = Annotated[Path | None, Parameter(name="--keys")]
Insecure: TypeAlias = Annotated[bool, Parameter(name="--insecure", negative="")]
Seed: TypeAlias = Annotated[int, Parameter(validator=Number(gte=0, lt=2**63))]
Runs: TypeAlias = Annotated[int, Parameter(validator=Number(gt=0, lte=1_000_000))]
Metres: TypeAlias = Annotated[float, Parameter(validator=Number(gte=-1e6, lte=1e6))]
"""A coordinate in the incident's frame, as ``shared.messages.Coordinate`` bounds it."""

JournalFile: TypeAlias = Annotated[Path | None, Parameter(name="--journal")]
