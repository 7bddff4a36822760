"""The agent's shell: samples to the mount, what it finds to the bus, at the pace of the clock.

The agent knows no time but that of its samples: whoever drives it waits for each (live) or does
not (rehearsal), and the same messages come out.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import chain

from edge_agent.alarm_repeats import AlarmRepeats
from edge_agent.alarms import AlarmEvent, AlarmWatch
from edge_agent.cues import CueDesk
from edge_agent.drop_desk import Beacon, DropDesk
from edge_agent.gnss import SpeedReading
from edge_agent.inertial.activity import ActivityClassifier, ActivityEstimate
from edge_agent.mounts.intake import has_gyro, readable
from edge_agent.mounts.interface import Increment, Mount, TakesSpeed
from edge_agent.mounts.methods import WITHOUT_GYRO, MountName
from edge_agent.self_check.checker import HealthReport, SelfCheck
from edge_agent.sources.reading import Quiet, Reading, TruePlace
from shared.messages import (
    HIGHEST_PRESSURE_PA,
    Alarm,
    ImuBatch,
    ImuSample,
    LocalPosition,
    NodeHealth,
    OdometryIncrement,
    TrackStart,
    Truth,
    Vector3,
)
from shared.sender import Sender
from shared.units import NS_PER_S

IMU_BATCH_S = 0.25
MOST_IN_A_BATCH = 500
MOST_FINDINGS = 16
CADENCE_CONFIDENCE = 0.5
"""Of an activity that a mount tells: legs are told by their pace alone."""

NOT_KEPT = "the unit's disk is full or fails: steps out of range are lost if it is switched off"


class Agent:
    """One responder's unit: takes samples in event time, sends what it makes of them."""

    def __init__(
        self,
        sender: Sender,
        mount: Mount,
        method: str,
        start: LocalPosition | None,
        *,
        worn: MountName = "boot",
        sends_imu: bool = True,
        stands_at: LocalPosition | None = None,
        keeps: Callable[[], bool] = lambda: True,
        drop_desk: DropDesk | None = None,
    ) -> None:
        """``start``: where the wearer stands at first; ``None`` if the post is to know.

        ``stands_at``: a known point where they report to stand then, and how near it.
        ``sends_imu``: publish the raw samples as well, for the record. ``keeps``: whether what is
        said is on disk, until it is safe elsewhere. ``drop_desk``: of a wearer who carries DAPs.
        """
        self._sender = sender
        self._keeps = keeps
        self._mount = mount
        self._method = method
        self._worn: MountName = worn
        self._start = start
        self._sends_imu = sends_imu
        self._classifier = ActivityClassifier()
        self._alarm_watch = AlarmWatch(worn=worn)
        self._alarm_repeats = AlarmRepeats()
        self._self_check = SelfCheck(mount.faults, worn=worn)
        self._cues = CueDesk(sender, stands_at)
        self._drop_desk = drop_desk
        self._batch: list[ImuSample] = []
        self._told_sd_rad: float | None = None
        self._moved = False
        self._samples = 0
        self.followed_until_ns: int | None = None
        """Until when all that the wearer moved is told; ``None`` before any sample."""
        self.start_payload: bytes | None = None
        """The newest start as it was sent, for posts that come late and ask; ``None`` before."""

    @property
    def why_no_movement(self) -> str | None:
        """Why no movement was told so far, in words; ``None`` if some was."""
        if self._moved:
            return None
        if not self._samples:
            return "no sample came"
        if not self._mount.ready:
            return f"the {self._worn} was never still: stand for some seconds at first"
        return f"no step was found: the wearer stood, or the sensor is not worn as {self._worn}"

    def forget_place(self) -> None:
        """Note that the wearer may have gone on from where they stood: the post is to know.

        To be called before the first reading.
        """
        self._start = None
        self._cues = CueDesk(self._sender)

    def take(self, reading: Reading) -> None:
        """Take in a sample, whose time is on the clock the incident goes by, or the truth."""
        if isinstance(reading, TruePlace):
            self._send_truth(reading)
            return
        if isinstance(reading, SpeedReading):
            if isinstance(self._mount, TakesSpeed):
                self._mount.know_speed(reading.speed_m_s, reading.sd_m_s)
            return
        self.pass_time(reading.time_ns)
        if isinstance(reading, ImuSample):
            self._take_sample(reading)
        elif isinstance(reading, Beacon):
            if self._drop_desk is not None:
                self._drop_desk.hear(reading)
        elif not isinstance(reading, Quiet):
            self._cues.take(reading)

    def pass_time(self, now_ns: int) -> None:
        """Note that it is ``now_ns``, with no sample until then.

        It may be called as often as one likes: what is sent is the same, and only sooner.
        """
        self._cues.pass_time(now_ns)
        report = self._self_check.pass_time(now_ns)
        if report is not None:
            self._send_health(report)

    def finish(self) -> None:
        """Send what is still held: no more samples will come."""
        for increment in self._mount.finish():
            self._moved = True
            self._send_increment(increment)
        if self._batch:
            self._send_batch()

    def _take_sample(self, sample: ImuSample) -> None:
        self._samples += 1
        if self._sends_imu:
            self._record(sample)
        if self._worn == "boot":
            self._classifier.take_sample(sample)
        increment = self._mount.step(sample)
        self._watch(sample)
        # The first heading gets better, or doubtful, as long as the wearer stands.
        if not self._moved and self._mount.ready:
            heading_sd_rad = self._mount.heading_sd_rad
            if heading_sd_rad != self._told_sd_rad:
                self._told_sd_rad = heading_sd_rad
                start_ns = sample.time_ns if increment is None else increment.start_time_ns
                self._send_start(start_ns, heading_sd_rad)
        if increment is not None:
            self._moved = True
            self._send_increment(increment)
        follows = self._mount.ready and readable(sample, needs_gyro=self._worn not in WITHOUT_GYRO)
        if follows or self.followed_until_ns is None:
            self.followed_until_ns = sample.time_ns

    def _watch(self, sample: ImuSample) -> None:
        """Send the alarms and the findings that a sample gives rise to."""
        # Nobody is hurt because an engine is parked.
        if self._worn != "vehicle":
            events = self._alarm_watch.take_sample(sample)
            for event in self._alarm_repeats.due(events, sample.time_ns):
                self._send_alarm(event)
        report = self._self_check.take_sample(sample)
        if report is not None:
            self._send_health(report)

    def _send_truth(self, place: TruePlace) -> None:
        north_m, east_m, down_m = place.position_m
        self._sender.send(
            Truth(
                event_time_ns=place.time_ns,
                sequence=self._sender.next_sequence(Truth),
                north_m=north_m,
                east_m=east_m,
                down_m=down_m,
            )
        )

    def _record(self, sample: ImuSample) -> None:
        # A batch with one number out of bounds would be refused whole.
        if not readable(sample, needs_gyro=self._worn not in WITHOUT_GYRO):
            return
        # All samples of a batch have a field, or none has; and so with rates.
        if self._batch and _sensors(self._batch[0]) != _sensors(sample):
            self._send_batch()
        self._batch.append(sample)
        lasted_ns = sample.time_ns - self._batch[0].time_ns
        if lasted_ns >= IMU_BATCH_S * NS_PER_S or len(self._batch) >= MOST_IN_A_BATCH:
            self._send_batch()

    def _send_start(self, time_ns: int, heading_sd_rad: float) -> None:
        self.start_payload = self._sender.send(
            TrackStart(
                event_time_ns=time_ns,
                sequence=self._sender.next_sequence(TrackStart),
                position=self._start,
                heading_sd_rad=heading_sd_rad,
                mount=self._worn,
                method=self._method,
            )
        )

    def _send_increment(self, increment: Increment) -> None:
        d_north_m, d_east_m, d_down_m = increment.displacement_m
        activity = self._activity(increment)
        self._alarm_watch.flat = self._classifier.flat
        self._self_check.worn = self._mount.worn
        self._self_check.take_increment(increment)
        told = OdometryIncrement(
            event_time_ns=increment.end_time_ns,
            sequence=self._sender.next_sequence(OdometryIncrement),
            start_time_ns=increment.start_time_ns,
            d_north_m=d_north_m,
            d_east_m=d_east_m,
            d_down_m=d_down_m,
            d_heading_rad=increment.d_heading_rad,
            heading_rad=increment.heading_rad,
            covariance=increment.covariance,
            mount=self._worn,
            activity=activity.activity,
            activity_confidence=activity.confidence,
            facing_sd_rad=increment.facing_sd_rad,
        )
        self._sender.send(told)
        if self._drop_desk is not None:
            self._drop_desk.move(told)

    def _activity(self, increment: Increment) -> ActivityEstimate:
        """Return what the wearer did; only a boot's posture has to be asked for it."""
        if self._worn == "boot":
            return self._classifier.take_increment(increment)
        if increment.activity is None:
            return ActivityEstimate("unknown", 0.0, f"a {self._worn} does not tell")
        return ActivityEstimate(increment.activity, CADENCE_CONFIDENCE, "by the mount")

    def _send_alarm(self, event: AlarmEvent) -> None:
        self._sender.send(
            Alarm(
                event_time_ns=event.time_ns,
                sequence=self._sender.next_sequence(Alarm),
                kind=event.kind,
                phase=event.phase,
                confidence=event.confidence,
                reason=event.reason,
            )
        )

    def _send_health(self, report: HealthReport) -> None:
        level, findings = report.level, report.findings
        if not self._keeps():
            level = "warning" if level == "ok" else level
            findings = (*findings[: MOST_FINDINGS - 1], NOT_KEPT)
        self._sender.send(
            NodeHealth(
                event_time_ns=report.time_ns,
                sequence=self._sender.next_sequence(NodeHealth),
                level=level,
                findings=findings,
            )
        )

    def _send_batch(self) -> None:
        batch, self._batch = self._batch, []
        fields_ut = [sample.field_ut for sample in batch if sample.field_ut is not None]
        # One out of the wire's bounds is no reading to a mount either.
        pressures_pa = {
            row: sample.pressure_pa
            for row, sample in enumerate(batch)
            if sample.pressure_pa is not None and 0.0 <= sample.pressure_pa <= HIGHEST_PRESSURE_PA
        }
        self._sender.send(
            ImuBatch(
                event_time_ns=batch[-1].time_ns,
                sequence=self._sender.next_sequence(ImuBatch),
                time_ns=tuple(sample.time_ns for sample in batch),
                force_m_s2=_flat([sample.force_m_s2 for sample in batch]),
                rate_rad_s=_flat([sample.rate_rad_s for sample in batch if has_gyro(sample)]),
                field_ut=_flat(fields_ut),
                pressure_pa=tuple(pressures_pa.values()),
                pressure_rows=tuple(pressures_pa),
            )
        )


def _sensors(sample: ImuSample) -> tuple[bool, bool]:
    """Return whether a sample has a rate, and a field."""
    return has_gyro(sample), sample.field_ut is not None


def _flat(vectors: list[Vector3]) -> tuple[float, ...]:
    return tuple(chain.from_iterable(vectors))
