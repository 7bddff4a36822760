"""Where this DAP stands, as far as it is known.

A DAP is carried; then it is installed, by somebody at some time; and then the command post tells
where that was. Being set down again begins a new installation, of which nothing is known yet.
"""

from __future__ import annotations

from typing import Literal, NamedTuple, TypeAlias

import msgspec

from shared.messages import DapEstimate, LocalPosition, NodeId, TimeNs
from shared.units import NS_PER_S

Stage: TypeAlias = Literal["carried", "installed", "placed"]


class Installation(NamedTuple):
    """That the DAP was set down: when, by whom if somebody did, and where if that is known."""

    time_ns: int
    installer_id: NodeId | None
    position: LocalPosition | None


MOST_OFF_NS = 900 * NS_PER_S
"""Who was switched off for longer may have been carried meanwhile."""


class Machine(NamedTuple):
    """The machine a DAP runs on: which start of it this is, and what its two clocks read.

    ``steady_ns`` counts since that start, ``now_ns`` is what may be set.
    """

    boot: str
    steady_ns: int
    now_ns: int


class StandingNote(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Where a DAP stood when it was at work last: what it ``said`` of that, and when that was."""

    incident: NodeId
    said: bytes
    boot: str
    steady_ns: TimeNs
    noted_ns: TimeNs


def why_elsewhere(note: StandingNote, incident: NodeId, machine: Machine) -> str | None:
    """Say why a DAP that was begun anew stands no more where it stood; ``None`` if it does.

    It may not have been noted for long, and nobody knows what was then: a reboot takes a minute.
    """
    if note.incident != incident:
        return f"that was in another incident, {note.incident!r}"
    same_start = note.boot == machine.boot != ""
    off_ns = machine.steady_ns - note.steady_ns if same_start else machine.now_ns - note.noted_ns
    if off_ns < 0:
        return "the clock was set back: nobody knows how long it was switched off"
    if off_ns > MOST_OFF_NS:
        return f"it was switched off for {off_ns // (60 * NS_PER_S)} minutes"
    return None


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

    def take_up(self) -> None:
        """Note that the DAP does not stand any more."""
        self._installation = None

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
