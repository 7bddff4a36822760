"""Hands events to the fusion, each in its own way (pure)."""

from __future__ import annotations

from command_post.fusion.interface import Fusion
from command_post.nodes.both_ways import BothWays, Side
from command_post.nodes.told import why_nowhere
from shared.messages import (
    Contact,
    DapInstallation,
    DapPeak,
    HeightFix,
    Message,
    OdometryIncrement,
    PositionFix,
    ProximityEvent,
    RssiPeak,
    TrackStart,
)
from shared.topics import TOPICS, Key

FUSED = frozenset(
    name
    for name, topic in TOPICS.items()
    if topic.message
    in {
        TrackStart, OdometryIncrement, ProximityEvent, RssiPeak, DapPeak, Contact, PositionFix,
        HeightFix, DapInstallation,
    }
)  # fmt: skip
"""The topics whose messages the fusion is given."""


class HandingOver:
    """Gives the tracker what nodes tell; a pass that both ends of a link tell of, once.

    ``nowhere`` is why it is not known where a DAP stands that had stood somewhere, by its id.
    """

    def __init__(self, tracker: Fusion) -> None:
        self._tracker = tracker
        self._both_ways = BothWays()
        self.nowhere: dict[str, str] = {}

    @property
    def told_by_both(self) -> int:
        """How many passes both ends of a link told of."""
        return self._both_ways.repeated

    def give(self, node_id: str, message: Message) -> None:
        """Let the tracker have what a node tells, in the order of time."""
        match message:
            case TrackStart() as start:
                self._tracker.start(node_id, start)
            case OdometryIncrement() as increment:
                self._tracker.move(node_id, increment)
            case ProximityEvent() as near:
                self._tracker.near(node_id, near)
            case RssiPeak() as peak:
                self._pass("dap", node_id, peak)
            case DapPeak() as peak:
                self._pass("responder", peak.dap_id, _from_the_dap(node_id, peak))
            case Contact() as contact:
                self._tracker.contact(node_id, contact)
            case PositionFix() as fix:
                self._tracker.fix(fix)
            case HeightFix() as height:
                self._tracker.height_fix(height)
            case DapInstallation() as said:
                self._tracker.install(node_id, said)
                self._note_place(node_id, said)

    def faults(self, dap_id: str) -> list[str]:
        """Return why it is not known where a DAP stands, if that is so."""
        known = dap_id in self._tracker.daps or dap_id not in self.nowhere
        return [] if known else [self.nowhere[dap_id]]

    def _note_place(self, dap_id: str, said: DapInstallation) -> None:
        why = why_nowhere(said)
        if why is None:
            self.nowhere.pop(dap_id, None)
        elif dap_id not in self._tracker.daps:
            self.nowhere[dap_id] = why

    def _pass(self, side: Side, dap_id: str, peak: RssiPeak) -> None:
        """Let the tracker have a pass of a DAP, of whichever side tells of it first."""
        if not self._both_ways.is_told(side, dap_id, peak.responder_id, peak.event_time_ns):
            self._tracker.peak(dap_id, peak)


def _from_the_dap(responder_id: str, peak: DapPeak) -> RssiPeak:
    """Return what the DAP would have said of a pass that the responder's unit tells of."""
    return RssiPeak(
        event_time_ns=peak.event_time_ns, sequence=peak.sequence, responder_id=responder_id,
        peak_dbm=peak.peak_dbm, width_s=peak.width_s, sample_count=peak.sample_count,
    )  # fmt: skip


def is_ones_own(key: Key, message: Message) -> bool:
    """Say whether a unit that tells a place or a height tells its own."""
    match message:
        case PositionFix():
            return message.responder_id == key.node_id
        case HeightFix():
            return (message.node, message.node_id) == (key.role, key.node_id)
        case _:
            return True
