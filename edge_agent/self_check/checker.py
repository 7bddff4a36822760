"""Looks at samples a second at a time, and tells what is wrong with the sensor that gives them.

Findings are over the last ten seconds, so that a fault that comes and goes is neither missed nor
flickers.
"""

from __future__ import annotations

from collections import deque
from dataclasses import replace
from typing import NamedTuple

from edge_agent.mounts.interface import Faults, Increment
from edge_agent.self_check.findings import STRIDES, Finding, Seen, findings_of
from edge_agent.self_check.gyro_agreement import GyroAgreement
from edge_agent.self_check.second import SECONDS, Second, measure
from edge_agent.self_check.settings import SLOW_HZ, SelfCheckSettings
from shared.messages import HealthLevel, ImuSample, Mount
from shared.units import NS_PER_S


class HealthReport(NamedTuple):
    """Findings in words, worst first, and the level of the worst."""

    time_ns: int
    level: HealthLevel
    findings: tuple[str, ...]


class SelfCheck:
    """Takes samples and increments in order; reports on change, and every ``period_s``.

    ``faults`` are the counts of the mount that is given the same samples, ``worn`` says which.
    """

    def __init__(
        self, faults: Faults, settings: SelfCheckSettings | None = None, *, worn: Mount = "boot"
    ) -> None:
        self._faults = faults
        self._slow_hz = SLOW_HZ.get(worn)
        self._worn = worn.capitalize()
        words = f"{self._worn} sensor has stopped sending: check its battery and its cable"
        self._stalled = (Finding("fault", words),)
        self._settings = settings or SelfCheckSettings()
        self._counted = replace(faults)
        self._samples: list[ImuSample] = []
        self._stall_ns = round(self._settings.stall_s * NS_PER_S)
        self._second_from_ns: int | None = None
        self._newest_ns = 0
        self._seconds: deque[Second] = deque(maxlen=SECONDS)
        self._agreement = GyroAgreement()
        self._bias_rad_s = 0.0
        self._gravity_off_m_s2 = 0.0
        self._strides: deque[float] = deque(maxlen=STRIDES)
        self._told: tuple[Finding, ...] | None = None
        self._told_ns = 0
        self.worn: str | None = None
        """How the sensor was found to be worn, in words; to be set by who finds it."""

    def take_sample(self, sample: ImuSample) -> HealthReport | None:
        """Take in a sample as it came from the source; return a report if one is due."""
        self._samples.append(sample)
        now_ns = sample.time_ns
        self._newest_ns = now_ns
        if self._second_from_ns is None:
            self._second_from_ns = now_ns
        if 0 <= now_ns - self._second_from_ns < NS_PER_S:
            return None
        samples, self._samples = self._samples, []
        self._second_from_ns = now_ns
        self._look_at(samples)
        return self._report(now_ns, self._findings())

    def take_increment(self, increment: Increment) -> None:
        """Take in a movement, for whether it ended in a stance in good time."""
        self._strides.append((increment.end_time_ns - increment.start_time_ns) / NS_PER_S)

    def pass_time(self, now_ns: int) -> HealthReport | None:
        """Return the report that samples have stopped, if by ``now_ns`` they have, once.

        It bears the time at which that became certain, whenever it is asked for.
        """
        stalled_ns = self._newest_ns + self._stall_ns
        if now_ns < stalled_ns or self._second_from_ns is None or self._told == self._stalled:
            return None
        return self._report(stalled_ns, self._stalled)

    def _report(self, now_ns: int, findings: tuple[Finding, ...]) -> HealthReport | None:
        due = not 0 <= now_ns - self._told_ns < self._settings.period_s * NS_PER_S
        if self._told is not None and not due and _kinds(findings) == _kinds(self._told):
            return None
        self._told, self._told_ns = findings, now_ns
        level = findings[0].level if findings else "ok"
        return HealthReport(now_ns, level, tuple(finding.words for finding in findings))

    def _look_at(self, samples: list[ImuSample]) -> None:
        """Measure a second; bias and gravity too, if the sensor stood still in it."""
        if self._worn != "Boot":
            self._agreement.take(samples)
        faults, self._counted = self._counted, replace(self._faults)
        since = Faults(
            self._faults.unusable - faults.unusable,
            self._faults.out_of_order - faults.out_of_order,
            self._faults.gaps - faults.gaps,
            self._faults.restarts - faults.restarts,
        )
        second = measure(samples, since, self._settings)
        self._seconds.append(second)
        if second.rest is not None:
            self._bias_rad_s = second.rest.rate_rad_s
            self._gravity_off_m_s2 = second.rest.force_m_s2 - self._settings.gravity_m_s2

    def _findings(self) -> tuple[Finding, ...]:
        seen = Seen(
            self._worn,
            self._slow_hz,
            self._settings,
            self._seconds,
            self._bias_rad_s,
            self._gravity_off_m_s2,
            self._agreement.forces_contradict,
            self._agreement.compass_contradicts,
            self._strides,
        )
        return (*findings_of(seen), *([Finding("ok", self.worn)] if self.worn else []))


def _kinds(findings: tuple[Finding, ...]) -> list[tuple[str, str]]:
    """Return what findings are about, without the numbers in their words."""
    return [
        (finding.level, "".join(letter for letter in finding.words if not letter.isdigit()))
        for finding in findings
    ]
