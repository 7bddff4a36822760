"""The table of stations as it was told last, on disk: for a restart where there is no post."""

from __future__ import annotations

from pathlib import Path

import msgspec
import structlog

from shared.files import replace_atomically
from shared.messages import StationTable

_log = structlog.stdlib.get_logger(__name__)


class KeptStations:
    """The table beside a node's journal."""

    def __init__(self, journal: Path) -> None:
        self._path = journal.with_name(f"{journal.name}.stations")

    def load(self) -> StationTable | None:
        """Return what was kept; ``None`` if nothing was, or it cannot be read, which is said."""
        try:
            return msgspec.json.decode(self._path.read_bytes(), type=StationTable)
        except FileNotFoundError:
            return None
        except (OSError, msgspec.MsgspecError, UnicodeDecodeError) as error:
            _log.warning("the stations kept are not known", file=str(self._path), why=str(error))
            return None

    def keep(self, table: StationTable) -> None:
        """Put ``table`` in the place of the one before; a disk that fails is said."""
        try:
            with replace_atomically(self._path) as file:
                file.write(msgspec.json.encode(table))
        except OSError as error:
            _log.warning("the stations are not kept for a restart", why=str(error))
