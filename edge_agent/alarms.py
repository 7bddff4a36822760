"""Motionless and fall (pure): what the samples of one sensor say by themselves, without a filter.

*Motionless*, as a PASS device has it: a pre-alarm and an alarm after so long without motion,
cancelled by motion. *Fall*: an impact after which the boot comes to rest at once, no longer flat,
and stays so. Time is that of the samples. A stream that stops is not stillness: a gap counts for
nothing, and is the self-check's to tell.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from edge_agent.confidence import confidence_of
from edge_agent.mounts.intake import LARGEST_READING, RESTART_AFTER, has_gyro
from shared.maths.rotations import Vector3, angle_between_rad
from shared.messages import AlarmKind, AlarmPhase, ImuSample
from shared.units import NS_PER_S

NO_TURN: Vector3 = (0.0, 0.0, 0.0)
"""What a sensor without a gyroscope is taken to turn: force alone tells whether it moves."""

POSTURE_PERIOD_NS = 100_000_000
"""Posture is looked at this often."""

PAUSE_S = 1.0
"""Stillness as long as this breaks motion off."""


class AlarmSettings(NamedTuple):
    """When to raise an alarm.

    Moving is a rate above ``moving_rad_s``, or specific force averaged over ``quick_s`` that is
    ``moving_m_s2`` off its average over ``slow_s``, for ``moving_s`` in all. Breathing moves a
    boot by a tenth of either, and lone spikes are over sooner. Up to ``lift_m_s2`` along gravity
    are a lift's, which stirs nobody in it: who lies still there is as still as anywhere.
    """

    pre_alarm_s: float = 20.0
    alarm_s: float = 30.0
    moving_rad_s: float = 0.15
    moving_m_s2: float = 0.6
    moving_s: float = 0.1
    lift_m_s2: float = 2.0
    quick_s: float = 0.1
    slow_s: float = 3.0
    gap_s: float = 0.5
    impact_m_s2: float = 30.0
    impact_width_m_s2: float = 20.0
    settle_s: float = 1.5
    """So long after the impact the boot must have come to rest."""

    upright_s: float = 3.0
    """So short before the impact it must have stood flat: a crawler's knocks are no fall."""

    tilt_deg: float = 45.0
    tilt_width_deg: float = 20.0
    fall_still_s: float = 5.0
    fall_confidence: float = 0.5
    fall_over_s: float = 3.0
    """Motion unbroken for so long cancels a fall: who stirs is still down."""


class AlarmEvent(NamedTuple):
    """An alarm raised, made worse, or cancelled; ``confidence`` is 0 to 1."""

    time_ns: int
    kind: AlarmKind
    phase: AlarmPhase
    confidence: float
    reason: str


class AlarmWatch:
    """Takes samples in order; tells each alarm once, and once that it is over.

    ``flat`` is gravity's direction in sensor axes while the boot stands flat (any length), set by
    who learns it; without it no fall is told.
    """

    def __init__(self, settings: AlarmSettings | None = None, *, worn: str = "boot") -> None:
        self._settings = settings or AlarmSettings()
        self._worn = worn
        self._stillness = _Stillness(self._settings)
        self._fall = _FallSigns(self._settings)
        self._motionless: AlarmPhase = "cancelled"
        self._fallen = False
        self.flat: Vector3 | None = None

    def take_sample(self, sample: ImuSample) -> list[AlarmEvent]:
        """Take in a sample; return what it raises or cancels.

        One that no sensor can have read, or that is not later than the last, is passed over;
        a clock that stays set back is believed, and what stillness there was still counts.
        """
        fx, fy, fz = sample.force_m_s2
        force_m_s2 = math.sqrt(fx * fx + fy * fy + fz * fz)
        if not force_m_s2 <= LARGEST_READING:
            return []
        stillness, now_ns, before_ns = self._stillness, sample.time_ns, self._stillness.newest_ns
        if not stillness.take(sample):
            if stillness.newest_ns < before_ns:
                self._fall = _FallSigns(self._settings)
            return []
        self._fall.take(now_ns, force_m_s2, stillness, self.flat)
        if stillness.still_since_ns != now_ns:
            return self._raise(now_ns)
        return self._cancel(now_ns) if self._fallen or self._motionless != "cancelled" else []

    def _raise(self, now_ns: int) -> list[AlarmEvent]:
        """Return the alarms that stillness until now makes due."""
        settings = self._settings
        events: list[AlarmEvent] = []
        still_s = (now_ns - self._stillness.still_since_ns) / NS_PER_S
        due: AlarmPhase = "cancelled"
        if still_s >= settings.alarm_s:
            due = "alarm"
        elif still_s >= settings.pre_alarm_s:
            due = "pre_alarm"
        if due not in ("cancelled", self._motionless):
            self._motionless = due
            reason = f"no motion of the {self._worn} for {still_s:.0f} s"
            events.append(AlarmEvent(now_ns, "motionless", due, 1.0, reason))
        if not self._fallen and still_s >= settings.fall_still_s:
            fall = self._fall.judge(now_ns, self._stillness, self.flat)
            if fall is not None:
                self._fallen = True
                events.append(fall)
        return events

    def _cancel(self, now_ns: int) -> list[AlarmEvent]:
        """Return the alarms that motion up to now has ended."""
        events: list[AlarmEvent] = []
        if self._motionless != "cancelled":
            self._motionless = "cancelled"
            events.append(
                AlarmEvent(now_ns, "motionless", "cancelled", 1.0, f"the {self._worn} moves")
            )
        moving_s = (now_ns - self._stillness.moving_since_ns) / NS_PER_S
        if self._fallen and moving_s >= self._settings.fall_over_s:
            self._fallen = False
            reason = f"the {self._worn} has been moving for {moving_s:.0f} s"
            events.append(AlarmEvent(now_ns, "fall", "cancelled", 1.0, reason))
        return events


class _Stillness:
    """Since when the boot has been still, or moving.

    ``force_m_s2`` is averaged over ``slow_s``, ``quick_force_m_s2`` over ``quick_s``.
    """

    def __init__(self, settings: AlarmSettings) -> None:
        self._moving_rad2_s2, self._moving_m2_s4 = settings.moving_rad_s**2, settings.moving_m_s2**2
        self._lift_m2_s4 = settings.lift_m_s2**2
        self._moving_s, self._gap_s = settings.moving_s, settings.gap_s
        self._quick_s, self._slow_s = settings.quick_s, settings.slow_s
        self.newest_ns = -1
        self._backward = 0
        self._stirred_s = 0.0
        self.quick_force_m_s2: Vector3 = (0.0, 0.0, 0.0)
        self.force_m_s2: Vector3 = (0.0, 0.0, 0.0)
        self.still_since_ns = 0
        """The newest sample's time while the boot moves."""

        self.moving_since_ns = 0

    def take(self, sample: ImuSample) -> bool:
        """Take in a sample; return whether it tells anything."""
        wx, wy, wz = sample.rate_rad_s if has_gyro(sample) else NO_TURN
        rate2 = wx * wx + wy * wy + wz * wz
        now_ns, last_ns = sample.time_ns, self.newest_ns
        if not rate2 <= LARGEST_READING**2:
            return False
        if now_ns <= last_ns:
            self._backward += 1
            if self._backward >= RESTART_AFTER:
                self._move_times(now_ns)
            return False
        self._backward = 0
        self.newest_ns = now_ns
        if last_ns < 0:
            self.quick_force_m_s2 = self.force_m_s2 = sample.force_m_s2
            self.still_since_ns = self.moving_since_ns = now_ns
            return False
        since_s = (now_ns - last_ns) / NS_PER_S
        if since_s > self._gap_s:
            # Nobody knows what happened meanwhile.
            self.still_since_ns += now_ns - last_ns
            return False
        moves = self._average(sample.force_m_s2, since_s) > self._moving_m2_s4
        if rate2 > self._moving_rad2_s2:
            moves = True
            # It comes to rest in another posture: the old one must not pass for motion then.
            self.force_m_s2 = self.quick_force_m_s2
        self._stir(now_ns, since_s, moves=moves)
        return True

    def _stir(self, now_ns: int, since_s: float, *, moves: bool) -> None:
        """Note whether the boot moves; it has been still until it has moved for a while."""
        stirred_s = self._stirred_s
        if moves:
            stirred_s = min(stirred_s + since_s, 2.0 * self._moving_s)
        elif stirred_s > 0.0:
            stirred_s = max(stirred_s - since_s, 0.0)
        self._stirred_s = stirred_s
        if stirred_s >= self._moving_s:
            if now_ns - self.still_since_ns > PAUSE_S * NS_PER_S:
                self.moving_since_ns = now_ns
            self.still_since_ns = now_ns

    def _move_times(self, now_ns: int) -> None:
        """Carry what is known over to a clock that has been set back to ``now_ns``."""
        by_ns = now_ns - self.newest_ns
        self.still_since_ns += by_ns
        self.moving_since_ns += by_ns
        self.newest_ns, self._backward = now_ns, 0

    def _average(self, force_m_s2: Vector3, since_s: float) -> float:
        """Follow specific force quickly and slowly; return the square of how far these differ.

        What a lift may do to that, along the slow one, is left out.
        """
        a, b = since_s / self._quick_s, since_s / self._slow_s
        if a > 1.0:
            a, b = 1.0, min(1.0, b)
        fx, fy, fz = force_m_s2
        x, y, z = self.quick_force_m_s2
        x += a * (fx - x)
        y += a * (fy - y)
        z += a * (fz - z)
        u, v, w = self.force_m_s2
        u += b * (fx - u)
        v += b * (fy - v)
        w += b * (fz - w)
        self.quick_force_m_s2, self.force_m_s2 = (x, y, z), (u, v, w)
        x, y, z = x - u, y - v, z - w
        off_m2_s4 = x * x + y * y + z * z
        if off_m2_s4 <= self._moving_m2_s4:
            return off_m2_s4
        along_m2_s4 = (x * u + y * v + z * w) ** 2 / (u * u + v * v + w * w or math.inf)
        return off_m2_s4 - (along_m2_s4 if along_m2_s4 <= self._lift_m2_s4 else 0.0)


class _FallSigns:
    """The hardest recent impact on a boot that had stood flat shortly before."""

    def __init__(self, settings: AlarmSettings) -> None:
        self._settings = settings
        self._impact_limit_m_s2 = settings.impact_m_s2
        self._flat_ns: int | None = None
        self._look_ns = 0
        self._impact_ns: int | None = None
        self._impact_m_s2 = 0.0
        self._judged_ns: int | None = None
        """Since when the boot had been still that was judged last: each stillness is, once."""

    def take(
        self, now_ns: int, force_m_s2: float, stillness: _Stillness, flat: Vector3 | None
    ) -> None:
        """Note an impact, and from time to time whether the boot is flat."""
        settings = self._settings
        if force_m_s2 >= self._impact_limit_m_s2:
            stood_ns = self._flat_ns
            if stood_ns is not None and now_ns - stood_ns <= settings.upright_s * NS_PER_S:
                before_ns = self._impact_ns
                if before_ns is not None and now_ns - before_ns <= settings.settle_s * NS_PER_S:
                    force_m_s2 = max(force_m_s2, self._impact_m_s2)
                self._impact_ns, self._impact_m_s2 = now_ns, force_m_s2
        if flat is not None and now_ns >= self._look_ns:
            self._look_ns = now_ns + POSTURE_PERIOD_NS
            if _angle_deg(stillness.quick_force_m_s2, flat) < settings.tilt_deg:
                self._flat_ns = now_ns

    def judge(self, now_ns: int, stillness: _Stillness, flat: Vector3 | None) -> AlarmEvent | None:
        """Return the fall that the boot, at rest for long enough, lies after, if it does."""
        settings, impact_ns = self._settings, self._impact_ns
        if impact_ns is None or flat is None or self._judged_ns == stillness.still_since_ns:
            return None
        self._judged_ns = stillness.still_since_ns
        if not 0 <= stillness.still_since_ns - impact_ns <= settings.settle_s * NS_PER_S:
            return None
        tilt_deg = _angle_deg(stillness.force_m_s2, flat)
        hard = confidence_of(self._impact_m_s2 - settings.impact_m_s2, settings.impact_width_m_s2)
        tilted = confidence_of(tilt_deg - settings.tilt_deg, settings.tilt_width_deg)
        confidence = tilted * (0.5 + 0.5 * hard)
        if confidence < settings.fall_confidence:
            return None
        reason = f"impact of {self._impact_m_s2:.0f} m/s², then still, {tilt_deg:.0f}° from flat"
        return AlarmEvent(now_ns, "fall", "alarm", confidence, reason)


def _angle_deg(a: Vector3, b: Vector3) -> float:
    return math.degrees(angle_between_rad(a, b))
