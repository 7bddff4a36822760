"""Where a node's journal is, if the command line does not say."""

from __future__ import annotations

import os
import sys
from pathlib import Path

from shared.messages import NodeId
from shared.topics import Role


def journal_path(named: Path | None, incident: NodeId, role: Role, node_id: NodeId) -> Path:
    """Return ``named``, or else the node's own file among what programs keep for this user."""
    if named is not None:
        return named
    return _state_folder() / "clew" / f"{incident}-{role}-{node_id}.journal"


def _state_folder() -> Path:
    """Return the folder for what is to outlive a program, as the XDG specification has it."""
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local")
    named = os.environ.get("XDG_STATE_HOME", "")
    # A relative one is to be passed over, the specification says.
    return Path(named) if named.startswith("/") else Path.home() / ".local" / "state"
