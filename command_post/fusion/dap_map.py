"""The map that the responders make as they go: where the DAPs were set down."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Literal, NamedTuple, TypeAlias

from shared.messages import DapInstallation, LocalPosition

PlaceOf: TypeAlias = Callable[[str, int], LocalPosition | None]
"""Where a responder was held to be at a time in ns; ``None`` if nothing is known."""

Outcome: TypeAlias = Literal["placed", "repeated", "superseded", "unplaced", "taken_up"]


class InstalledDap(NamedTuple):
    """A DAP that stands: where it is frozen, since when, and who set it down."""

    position: LocalPosition
    installed_ns: int
    installer_id: str | None


class DapMap(Mapping[str, InstalledDap]):
    """The DAPs that stand, by id."""

    def __init__(self) -> None:
        self._daps: dict[str, InstalledDap] = {}
        self._taken_up_ns: dict[str, int] = {}

    def install(self, dap_id: str, said: DapInstallation, place_of: PlaceOf) -> Outcome:
        """Take in what a DAP says of its installation, and say what came of it.

        A position that it carries is taken as it is; without one, the DAP stands where
        ``place_of`` says its installer was at that time, ``unplaced`` if nobody knows. What is
        placed is frozen: the same installation said again (same event time) is ``repeated`` and
        changes nothing, an older one is ``superseded``, a newer one replaces it. One that was
        ``taken_up`` stands nowhere, until a newer installation places it.
        """
        standing = self._daps.get(dap_id)
        if said.event_time_ns <= self._taken_up_ns.get(dap_id, -1):
            return "superseded"
        if standing is not None and said.event_time_ns <= standing.installed_ns:
            same = said.event_time_ns == standing.installed_ns
            return "repeated" if same else "superseded"
        if said.position is None and said.installer_id is None:
            self._daps.pop(dap_id, None)
            self._taken_up_ns[dap_id] = said.event_time_ns
            return "taken_up"
        position = said.position
        if position is None and said.installer_id is not None:
            position = place_of(said.installer_id, said.event_time_ns)
        if position is None:
            return "unplaced"
        self._daps[dap_id] = InstalledDap(position, said.event_time_ns, said.installer_id)
        return "placed"

    def __getitem__(self, dap_id: str) -> InstalledDap:
        return self._daps[dap_id]

    def __iter__(self) -> Iterator[str]:
        return iter(self._daps)

    def __len__(self) -> int:
        return len(self._daps)
