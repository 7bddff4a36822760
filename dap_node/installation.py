"""Where this DAP stands, as far as it is known.

A DAP is carried; then it is installed, by somebody at some time; and then the command post tells
where that was. Being set down again begins a new installation, of which nothing is known yet.
"""

from __future__ import annotations

from typing import Literal, NamedTuple, TypeAlias

from shared.messages import DapEstimate, LocalPosition, NodeId

Stage: TypeAlias = Literal["carried", "installed", "placed"]


class Installation(NamedTuple):
    """That the DAP was set down: when, by whom if somebody did, and where if that is known."""

    time_ns: int
    installer_id: NodeId | None
    position: LocalPosition | None


class Standing:
    """What a DAP knows of its own place. It begins as carried."""

    def __init__(self, dap_id: NodeId) -> None:
        self._dap_id = dap_id
        self._installation: Installation | None = None

    @property
    def installation(self) -> Installation | None:
        """The newest there is to tell; ``None`` while the DAP is carried."""
        return self._installation

    @property
    def stage(self) -> Stage:
        """How much is known."""
        if self._installation is None:
            return "carried"
        return "installed" if self._installation.position is None else "placed"

    def set_down(self, installation: Installation) -> None:
        """Note that the DAP now stands, for the first time or anew."""
        self._installation = installation

    def learn(self, estimate: DapEstimate) -> Installation | None:
        """Take in where a post holds a DAP to stand; return the installation if that is news.

        The last told counts: a post that restarts numbers its messages from 0, so their numbers
        do not say which is newer. Estimates of another DAP, or of another installation of this
        one, are none of ours.
        """
        known = self._installation
        if known is None or estimate.dap_id != self._dap_id:
            return None
        if estimate.event_time_ns != known.time_ns or estimate.position == known.position:
            return None
        self._installation = known._replace(position=estimate.position)
        return self._installation
