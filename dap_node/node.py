"""The DAP's shell: what its scanner reports goes in, what there is to tell goes on the bus.

The node knows no time but that of what it is given: whoever drives it waits for each observation
(live) or does not (rehearsal), and the same messages come out.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable

import structlog

from dap_node.installation import Installation, Stage, Standing
from dap_node.neighbours import Neighbour, NeighbourWatch
from dap_node.proximity import Proximity, ProximityDetector
from dap_node.scanners.observation import Motion, Observation, PutElsewhere, Scan, SetDown
from dap_node.self_installation import AtRest, PutDown, SelfInstallation, TakenUp
from dap_node.settings import DapSettings
from shared.bus.inbox import Inbox
from shared.bus.interface import Bus, Received
from shared.codec import Refusal, decode, parse_key
from shared.gate import Gate
from shared.messages import (
    DapEstimate,
    DapInstallation,
    Message,
    NeighbourHeard,
    NodeId,
    ProximityEvent,
    RssiPeak,
    RssiReport,
    SetDownHere,
    StationTable,
    StrangerNoticed,
    Truth,
    Vector3,
)
from shared.radios.hearing import Heard, Hearing
from shared.radios.readings import RadioScan
from shared.rssi_peaks import Peak, PeakDetector
from shared.sender import Outbox, Sender
from shared.strangers import NOBODY, AtLinks, Strangers
from shared.topics import Key, Role, alive_key
from shared.units import NS_PER_S

INBOX_MESSAGES = 256
HEEDED: tuple[tuple[Role, str], ...] = (
    ("post", "dap_place"),
    ("post", "stations"),
    ("post", "set_down"),
    ("responder", "set_down"),
)
"""What a DAP listens to, and of whom."""

TRUTH_PERIOD_NS = 10 * NS_PER_S

_log = structlog.stdlib.get_logger(__name__)


class DapNode:
    """One DAP: takes observations in the order of time, and says what follows from them.

    ``refusals`` counts, by reason, what was said to DAPs that could not be understood.
    """

    def __init__(
        self,
        bus: Bus,
        incident: NodeId,
        dap_id: NodeId,
        settings: DapSettings | None = None,
        *,
        sends_rssi: bool = True,
        outbox: Outbox | None = None,
        gate: Gate | None = None,
        stations: StationTable | None = None,
        keep_stations: Callable[[StationTable], object] = lambda _: None,
        keep_place: Callable[[bytes | None], object] = lambda _: None,
        watch: SelfInstallation | None = None,
        at_links: AtLinks = NOBODY,
        role_of: Callable[[str], Role] = lambda _: "responder",
    ) -> None:
        """``sends_rssi``: publish every reading as well, for the record.

        ``outbox``: see ``Sender``. ``gate``: lets in what is said to DAPs; without one, everybody
        is believed. ``stations``: whose radios are whose, until a post tells; what one tells is to
        be kept by ``keep_stations``. ``at_links``: what this DAP's router refuses, and
        ``role_of`` whose certificates are whose.
        """
        self._sends_rssi = sends_rssi
        settings = settings or DapSettings()
        self.refusals: Counter[str] = Counter()
        self._sender = Sender(bus, incident, "dap", dap_id, outbox)
        self._gate = gate or Gate()
        self._standing = Standing(dap_id)
        self._scale = settings.scale()
        self._proximity = ProximityDetector(settings.proximity)
        self._peaks = PeakDetector(settings.peaks)
        self._hearing = Hearing("dap", dap_id, stations)
        self._keep_stations = keep_stations
        self._neighbours = NeighbourWatch()
        self._strangers_told = False
        self._strangers = Strangers()
        self._at_links = at_links
        self._role_of = role_of
        self._watch = watch
        self._keep_place = keep_place
        self._is_taken_up = False
        self._heeded: dict[Key, SetDownHere] = {}
        self._place_payload: bytes | None = None
        self._truth_m: Vector3 | None = None
        self._truth_due_ns = 0
        self._inbox: Inbox[Received] = Inbox(INBOX_MESSAGES)
        for role, topic in HEEDED:
            bus.subscribe(str(Key(incident, role, "*", topic)), self._inbox.put)
        self._installation_key = Key(incident, "dap", dap_id, "installation")
        bus.answer(str(self._installation_key), lambda _: self._place_payload)
        bus.declare_alive(alive_key(incident, "dap", dap_id))

    @property
    def stage(self) -> Stage:
        """How much is known of where the DAP stands."""
        return self._standing.stage

    def go_on(self, said: bytes) -> None:
        """Take up the installation that was ``said`` before this process was broken off."""
        message = decode(self._installation_key, said)
        if not isinstance(message, DapInstallation):
            return
        if message.installer_id or message.position or message.at_rest:
            place = Installation(message.event_time_ns, message.installer_id, message.position)
            self._standing.set_down(place)
            if self._watch is not None:
                self._watch.stands()
            self._place_payload = said
            _log.info("stands still", installer_id=message.installer_id, stage=self.stage)

    def take(self, observation: Observation) -> None:
        """Take in what the scanner reports next, after what others have told meanwhile."""
        self._heed_others(observation.time_ns)
        match observation:
            case SetDown():
                self._set_down(observation)
            case Scan(time_ns, rssi_dbm):
                self._hear(
                    time_ns,
                    (
                        Heard(time_ns, "responder", responder_id, dbm)
                        for responder_id, dbm in rssi_dbm.items()
                    ),
                )
            case RadioScan():
                self._hear(observation.time_ns, self._hearing.sort_out(observation))
                self._tell_of_strangers()
            case PutElsewhere(time_ns, truth_m):
                self._truth_m, self._truth_due_ns = truth_m, time_ns
            case Motion() if self._watch is not None:
                for time_ns, force_m_s2 in observation.samples:
                    self._watch.feel(time_ns, force_m_s2)
        self._notice(observation.time_ns)
        self._tell_who_was_refused(observation.time_ns)
        self._keep_place(None if self.stage == "carried" else self._place_payload)
        self._tell_truth(observation.time_ns)

    def _set_down(self, report: SetDown) -> None:
        installer_id = report.installer_id
        if installer_id is None and report.position is None:
            watch = self._watch
            installer_id = None if watch is None else watch.loudest(report.time_ns)
            if installer_id is None:
                _log.error("set down, but nobody is heard who did: say where, or who")
                return
        installation = Installation(report.time_ns, installer_id, report.position)
        self._standing.set_down(installation)
        self._scale.set_down(report.time_ns, installer_id)
        if self._watch is not None:
            self._watch.stands()
        self._is_taken_up = False
        self._truth_m, self._truth_due_ns = report.truth_m, report.time_ns
        self._say_place(installation)
        _log.info("set down", installer_id=installer_id, stage=self.stage)

    def _notice(self, now_ns: int) -> None:
        """Say so if the DAP was set down, or taken up, without anybody telling it."""
        if self._watch is None:
            return
        match self._watch.tick(now_ns, stands=self.stage != "carried"):
            case PutDown(time_ns, installer_id):
                self._set_down(SetDown(time_ns, installer_id, None))
            case AtRest(time_ns):
                self._lie_still(Installation(time_ns, None, None))
            case TakenUp(time_ns):
                self._standing.take_up()
                self._is_taken_up = True
                self._say_place(Installation(time_ns, None, None))
                _log.warning("taken up: it is to be set down again")

    def _lie_still(self, somewhere: Installation) -> None:
        """Tell of who passes again: by that it will be found where the box is now."""
        self._standing.set_down(somewhere)
        self._scale.set_down(somewhere.time_ns, None)
        if self._watch is not None:
            self._watch.stands()
        self._is_taken_up = False
        self._say_place(somewhere, at_rest=True)
        _log.warning("lies still where nobody set it down: it is placed as it is passed")

    def _hear(self, now_ns: int, heard: Iterable[Heard]) -> None:
        for time_ns, role, node_id, rssi_dbm in heard:
            if role == "dap":
                self._neighbours.hear(time_ns, node_id, rssi_dbm)
                continue
            calibrated_dbm = self._scale.calibrated_dbm(time_ns, node_id, rssi_dbm)
            self._proximity.add(time_ns, node_id, calibrated_dbm)
            self._peaks.add(time_ns, node_id, calibrated_dbm)
            if self._watch is not None:
                self._watch.hear(time_ns, node_id, calibrated_dbm)
            if self._sends_rssi:
                self._say_reading(time_ns, node_id, rssi_dbm)
        if (learnt := self._scale.tick(now_ns)) is not None:
            _log.info(
                "calibrated by the installer",
                installer_db=round(learnt.installer_db, 1),
                others_db=round(learnt.others_db, 1),
                samples=learnt.sample_count,
            )
        near, peaks = self._proximity.tick(now_ns), self._peaks.tick(now_ns)
        # Who is near a box that somebody carries says nothing of where they are.
        if not self._is_taken_up:
            for proximity in near:
                self._say_near(proximity)
            for peak in peaks:
                self._say_peak(peak)
        for neighbour in self._neighbours.tick(now_ns):
            self._say_neighbour(now_ns, neighbour)

    def _tell_of_strangers(self) -> None:
        """Say once that there are some: a responder whose radio is not listed is not followed."""
        if self._hearing.strangers and not self._strangers_told:
            self._strangers_told = True
            _log.warning("radios are heard that are on no table: they are only counted")

    def _tell_who_was_refused(self, now_ns: int) -> None:
        for _, node_id, words in self._strangers.noticed(self._at_links):
            self._sender.send(
                StrangerNoticed(
                    event_time_ns=now_ns,
                    sequence=self._sender.next_sequence(StrangerNoticed),
                    role="dap" if node_id is None else self._role_of(node_id),
                    node_id=node_id or self._sender.node_id,
                    words=words,
                )
            )

    def _say_reading(self, time_ns: int, responder_id: NodeId, rssi_dbm: float) -> None:
        self._sender.send(
            RssiReport(
                event_time_ns=time_ns,
                sequence=self._sender.next_sequence(RssiReport),
                responder_id=responder_id,
                rssi_dbm=rssi_dbm,
            )
        )

    def _heed_others(self, now_ns: int) -> None:
        for received in self._inbox.get_all():
            why = self._gate.admit(*received)
            if why is not None:
                if why != "repeated":
                    self._refuse(received.key, why, "not let in")
                continue
            key = parse_key(received.key)
            message = key if isinstance(key, Refusal) else decode(key, received.payload)
            if isinstance(message, Refusal):
                self._refuse(received.key, *message)
            elif not isinstance(key, Refusal):
                self._heed(key, message, now_ns)

    def _heed(self, key: Key, message: Message, now_ns: int) -> None:
        match message:
            case DapEstimate():
                self._learn(message)
            case StationTable() if self._hearing.learn(message):
                self._keep_stations(message)
                self._strangers_told = False
                _log.info("stations", responders=len(message.responders), daps=len(message.daps))
            case SetDownHere(dap_id=dap_id, position=position) if dap_id == self._sender.node_id:
                # It may be said several times, for it is not answered.
                if self._heeded.get(key) != message:
                    self._heeded[key] = message
                    installer_id = key.node_id if key.role == "responder" else None
                    self._set_down(SetDown(now_ns, installer_id, position))

    def _learn(self, estimate: DapEstimate) -> None:
        installation = self._standing.learn(estimate)
        if installation is not None:
            self._say_place(installation)
            place = estimate.position
            _log.info("placed", north_m=round(place.north_m, 2), east_m=round(place.east_m, 2))

    def _refuse(self, key: str, reason: str, detail: str) -> None:
        self.refusals[reason] += 1
        if self.refusals[reason] == 1:
            _log.warning("refused", key=key, reason=reason, detail=detail)

    def _say_place(self, installation: Installation, *, at_rest: bool = False) -> None:
        place = DapInstallation(
            event_time_ns=installation.time_ns,
            sequence=self._sender.next_sequence(DapInstallation),
            installer_id=installation.installer_id,
            position=installation.position,
            at_rest=at_rest,
        )
        self._place_payload = self._sender.send(place)

    def _say_near(self, proximity: Proximity) -> None:
        heard, belief = proximity.heard, proximity.belief
        self._sender.send(
            ProximityEvent(
                event_time_ns=proximity.time_ns,
                sequence=self._sender.next_sequence(ProximityEvent),
                responder_id=proximity.responder_id,
                phase=proximity.phase,
                rssi_mean_dbm=heard.mean_dbm,
                rssi_variance_db2=heard.variance_db2,
                sample_count=heard.sample_count,
                near_log_odds=None if belief is None else belief.log_odds,
                range_m=None if belief is None else belief.range_m,
                range_sd_m=None if belief is None else belief.range_sd_m,
            )
        )

    def _say_peak(self, peak: Peak) -> None:
        self._sender.send(
            RssiPeak(
                event_time_ns=peak.time_ns,
                sequence=self._sender.next_sequence(RssiPeak),
                responder_id=peak.station_id,
                peak_dbm=peak.peak_dbm,
                width_s=peak.width_s,
                sample_count=peak.sample_count,
            )
        )

    def _say_neighbour(self, now_ns: int, neighbour: Neighbour) -> None:
        heard = neighbour.heard
        self._sender.send(
            NeighbourHeard(
                event_time_ns=now_ns,
                sequence=self._sender.next_sequence(NeighbourHeard),
                dap_id=neighbour.dap_id,
                rssi_mean_dbm=heard.mean_dbm,
                rssi_variance_db2=heard.variance_db2,
                sample_count=heard.sample_count,
            )
        )

    def _tell_truth(self, now_ns: int) -> None:
        """Say where the DAP really stands, now and then: whoever records late wants it too."""
        if self._truth_m is None or now_ns < self._truth_due_ns:
            return
        self._truth_due_ns = now_ns + TRUTH_PERIOD_NS
        north_m, east_m, down_m = self._truth_m
        self._sender.send(
            Truth(
                event_time_ns=now_ns,
                sequence=self._sender.next_sequence(Truth),
                north_m=north_m,
                east_m=east_m,
                down_m=down_m,
            )
        )
