"""What a unit tells of where its wearer is, beside their movement: whom they met, and fixes."""

from __future__ import annotations

from typing import Literal, NamedTuple, TypeAlias

from edge_agent.contacts import ContactWatch
from edge_agent.gnss import GnssGate, GnssReading, GnssSettings
from shared.messages import Contact, LocalPosition, NodeId, PositionFix
from shared.rssi_peaks import PeakSettings
from shared.sender import Sender


class Overheard(NamedTuple):
    """A reading of another responder's signal strength (dBm) at the unit."""

    time_ns: int
    other_id: NodeId
    rssi_dbm: float


Cue: TypeAlias = Overheard | GnssReading


class CueDesk:
    """Takes cues in event time, sends what follows from them."""

    def __init__(self, sender: Sender, stands_at: LocalPosition | None = None) -> None:
        """``stands_at``: where the wearer reports to stand as time begins, if they do."""
        self._sender = sender
        self._stands_at = stands_at
        self._contacts = ContactWatch(PeakSettings())
        self._gate = GnssGate(GnssSettings())

    def take(self, cue: Cue) -> None:
        """Take in a cue, whose time is on the clock the incident goes by."""
        self.pass_time(cue.time_ns)
        if isinstance(cue, Overheard):
            self._contacts.hear(*cue)
        elif (position := self._gate.take(cue)) is not None:
            self._send_fix(cue.time_ns, position, "gnss")

    def pass_time(self, now_ns: int) -> None:
        """Note that it is ``now_ns``, as often as one likes: what is sent is the same."""
        if self._stands_at is not None:
            self._send_fix(now_ns, self._stands_at, "known_point")
            self._stands_at = None
        for met in self._contacts.pass_time(now_ns):
            self._sender.send(
                Contact(
                    event_time_ns=met.time_ns,
                    sequence=self._sender.next_sequence(Contact),
                    other_id=met.station_id,
                    peak_dbm=met.peak_dbm,
                    width_s=met.width_s,
                    sample_count=met.sample_count,
                )
            )

    def _send_fix(
        self, time_ns: int, position: LocalPosition, source: Literal["gnss", "known_point"]
    ) -> None:
        self._sender.send(
            PositionFix(
                event_time_ns=time_ns,
                sequence=self._sender.next_sequence(PositionFix),
                responder_id=self._sender.node_id,
                source=source,
                position=position,
            )
        )
