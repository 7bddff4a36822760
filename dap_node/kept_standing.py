"""Where the DAP stands, on disk: after a reboot it does so still, unless it may have been moved.

The note is the box's, whatever the incident: it is how a DAP knows that a place is an old one's.
"""

from __future__ import annotations

import time
from pathlib import Path

import msgspec
import structlog

from dap_node.installation import Machine, StandingNote, why_elsewhere
from shared.clock import steady_ns
from shared.clock_spans import boot_id
from shared.files import replace_atomically
from shared.messages import NodeId

AGAIN_S = 60.0
"""What has not changed is noted again this often, for when the box was at work last."""

_log = structlog.stdlib.get_logger(__name__)


class KeptStanding:
    """The note of the DAP ``dap_id``, beside its ``journal``."""

    def __init__(self, journal: Path, incident: NodeId, dap_id: NodeId) -> None:
        self._path = journal.with_name(f"dap-{dap_id}.standing")
        self._incident = incident
        self._kept: bytes | None = None
        self._kept_s = 0.0

    def load(self) -> bytes | None:
        """Return what the DAP said of its place, if it stands there still; the log says why not."""
        try:
            note = msgspec.json.decode(self._path.read_bytes(), type=StandingNote)
        except FileNotFoundError:
            return None
        except (OSError, msgspec.MsgspecError, UnicodeDecodeError) as error:
            _log.warning("where the DAP stood is not known", file=str(self._path), why=str(error))
            return None
        why = why_elsewhere(note, self._incident, _machine())
        if why is None:
            return note.said
        _log.warning("does not stand where it stood: it is to be set down", why=why)
        return None

    def keep(self, said: bytes | None) -> None:
        """Note what the DAP says of its place, and that it is at work; ``None``: it is carried."""
        if said == self._kept and (said is None or time.monotonic() - self._kept_s < AGAIN_S):
            return
        self._kept, self._kept_s = said, time.monotonic()
        try:
            if said is None:
                self._path.unlink(missing_ok=True)
                return
            machine = _machine()
            note = StandingNote(
                incident=self._incident,
                said=said,
                boot=machine.boot,
                steady_ns=machine.steady_ns,
                noted_ns=machine.now_ns,
            )
            with replace_atomically(self._path) as file:
                file.write(msgspec.json.encode(note))
        except OSError as error:
            _log.warning("where the DAP stands is not kept for a restart", why=str(error))


def _machine() -> Machine:
    return Machine(boot_id(), steady_ns(), time.time_ns())
