"""Who is near the DAP, judged online from the strength of their signal, by one of two rules.

``published``: "Indoor location tracking for first responders using data network": RSSI falls with
range and its variance rises with it, so a responder is near while the mean of a sliding window is
above one threshold and the variance below another.

``likelihood``: a Bayes filter over the range (``range_filter``) holds it likely enough.

Both have hysteresis here, and a stay a least length. Only nearness is told, never a range, but
with it goes what the window held: mean, variance and number of samples.

Samples may be lost, late or repeated. They are only kept as they come; every decision is made in
``tick``, from what is then there, so that their order of arrival does not matter.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from math import fsum
from typing import Annotated, Literal, NamedTuple, TypeAlias

import msgspec
from msgspec import Meta

from dap_node.range_filter import RangeFilter
from dap_node.range_settings import Belief, RangeSettings
from shared.messages import NodeId
from shared.rssi_window import Readings, Summary, sum_up
from shared.units import NS_PER_S

Dbm: TypeAlias = Annotated[float, Meta(ge=-200.0, le=100.0)]
Variance: TypeAlias = Annotated[float, Meta(gt=0.0, le=1e4)]
Duration: TypeAlias = Annotated[float, Meta(gt=0.0, le=60.0)]
Phase: TypeAlias = Literal["entered", "near", "left"]
Method: TypeAlias = Literal["published", "likelihood"]

MEMORY_NS = 1800 * NS_PER_S
"""Of who is not heard for so long, nothing is remembered."""


class ProximitySettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """When a responder counts as near.

    By ``published``, one comes near when the window holds ``least_samples`` with a mean of at least
    ``enter_dbm`` and a variance of at most ``enter_variance_db2``, and is not any more when the
    mean is below ``leave_dbm`` or the variance above ``leave_variance_db2``. By ``likelihood``, it
    is as ``range`` says. Either way one is near for ``dwell_s`` at least, and until nothing has
    been heard for ``silence_s``. Nearness is told again every ``repeat_s``.
    """

    method: Method = "published"
    window_s: Duration = 1.5
    least_samples: Annotated[int, Meta(ge=2, le=1000)] = 4
    enter_dbm: Dbm = -49.0
    leave_dbm: Dbm = -52.0
    enter_variance_db2: Variance = 20.0
    leave_variance_db2: Variance = 30.0
    dwell_s: Duration = 1.0
    silence_s: Duration = 3.0
    repeat_s: Duration = 1.0
    range: RangeSettings = RangeSettings()

    def __post_init__(self) -> None:
        """Refuse thresholds that it takes more to keep than to reach, and a silence too short."""
        if self.leave_dbm > self.enter_dbm:
            raise ValueError("leave_dbm: put it at or below enter_dbm")
        if self.leave_variance_db2 < self.enter_variance_db2:
            raise ValueError("leave_variance_db2: put it at or above enter_variance_db2")
        if self.silence_s < self.window_s:
            raise ValueError("silence_s: put it at or above window_s")


class Proximity(NamedTuple):
    """Something to tell: a responder has come near, is still near, or has left.

    ``time_ns`` is when it was so: the middle of what was heard by ``published``, the newest reading
    by ``likelihood``; of a responder who has fallen silent it is when that was noticed, and
    ``heard`` is the last there was. Times never go back within a stay. ``belief`` is what
    ``likelihood`` holds of the range.
    """

    time_ns: int
    responder_id: NodeId
    phase: Phase
    heard: Summary
    belief: Belief | None = None


class Evidence(NamedTuple):
    """What there is to judge by at ``now_ns``: the window, if it holds anything, and the belief.

    ``last_heard_ns`` is the time of the newest reading there ever was.
    """

    now_ns: int
    last_heard_ns: int
    heard: Summary | None
    belief: Belief | None


class Witness:
    """Keeps what is heard of one station, and sums it up; with a belief if ``believes``."""

    def __init__(self, settings: ProximitySettings, *, believes: bool) -> None:
        self._window_ns = _ns(settings.window_s)
        self._readings = Readings()
        self._filter = RangeFilter(settings.range) if believes else None
        self._believed_ns = -1
        self._last_heard_ns = 0

    def add(self, time_ns: int, rssi_dbm: float) -> None:
        """Keep a sample; of several at one time the strongest."""
        self._readings.add(time_ns, rssi_dbm)

    def remembers(self, now_ns: int) -> bool:
        """Whether there is anything to remember."""
        has_belief = self._filter is not None and now_ns - self._last_heard_ns < MEMORY_NS
        return bool(self._readings) or has_belief

    def testify(self, now_ns: int) -> Evidence:
        """Sum up the window that ends now, and all that was heard so far.

        Samples are forgotten once they are too old, and wait while they are from the future.
        """
        since_ns = now_ns - self._window_ns
        belief = self._believe(now_ns)
        self._readings.forget_until(since_ns)
        due = self._readings.between(since_ns, now_ns)
        if due:
            self._last_heard_ns = max(due)
        return Evidence(now_ns, self._last_heard_ns, sum_up(due) if due else None, belief)

    def _believe(self, now_ns: int) -> Belief | None:
        if self._filter is None:
            return None
        new: Mapping[int, float] = self._readings.between(self._believed_ns, now_ns)
        for time_ns, rssi_dbm in sorted(new.items()):
            self._filter.hear(time_ns, rssi_dbm)
            self._believed_ns = time_ns
        return self._filter.believe(now_ns)


@dataclass
class _Stay:
    """A stay near the DAP: since when, when it was last due to be told, and what was last so."""

    entered_ns: int
    told_ns: int
    time_ns: int
    heard: Summary


class Stays:
    """Decides of one responder when they come near, stay and leave."""

    def __init__(self, responder_id: NodeId, settings: ProximitySettings) -> None:
        self._responder_id = responder_id
        self._settings = settings
        self._stay: _Stay | None = None
        self._believed: deque[tuple[int, float]] = deque()

    @property
    def is_near(self) -> bool:
        """Whether there is a stay."""
        return self._stay is not None

    def decide(self, evidence: Evidence) -> Proximity | None:
        """Return what there is to tell. Evidence must not go back in time."""
        heard, log_odds = self._usable(evidence), self._steady(evidence)
        if self._stay is not None:
            return self._tell_of(self._stay, heard, log_odds, evidence)
        if heard is None or not self._is_near(heard, log_odds):
            return None
        time_ns = self._time_ns(heard, evidence)
        self._stay = _Stay(evidence.now_ns, evidence.now_ns, time_ns, heard)
        return self._told(time_ns, "entered", heard, evidence.belief)

    def _tell_of(
        self, stay: _Stay, heard: Summary | None, log_odds: float | None, evidence: Evidence
    ) -> Proximity | None:
        """Return what there is to tell of a stay, having ended it if it is over."""
        now_ns, last_heard_ns, _, belief = evidence
        if now_ns - last_heard_ns >= _ns(self._settings.silence_s):
            self._stay = None
            return self._told(now_ns, "left", stay.heard, belief)
        # A late sample may bring the middle of the window back.
        if heard is None or self._time_ns(heard, evidence) < stay.time_ns:
            return None
        stay.time_ns, stay.heard = self._time_ns(heard, evidence), heard
        is_over = now_ns - stay.entered_ns >= _ns(self._settings.dwell_s)
        if is_over and self._is_gone(heard, log_odds):
            self._stay = None
            return self._told(stay.time_ns, "left", heard, belief)
        repeat_ns = _ns(self._settings.repeat_s)
        if now_ns - stay.told_ns >= repeat_ns:
            # Counted from the beginning, so that scans between seconds do not stretch the period.
            stay.told_ns = now_ns - (now_ns - stay.entered_ns) % repeat_ns
            return self._told(stay.time_ns, "near", heard, belief)
        return None

    def _told(self, time_ns: int, phase: Phase, heard: Summary, belief: Belief | None) -> Proximity:
        return Proximity(time_ns, self._responder_id, phase, heard, belief)

    def _usable(self, evidence: Evidence) -> Summary | None:
        """Return the window if it says enough for the rule."""
        heard = evidence.heard
        if self._is_published and heard is not None:
            return heard if heard.sample_count >= self._settings.least_samples else None
        return heard

    def _time_ns(self, heard: Summary, evidence: Evidence) -> int:
        return heard.time_ns if self._is_published else evidence.last_heard_ns

    def _steady(self, evidence: Evidence) -> float | None:
        """Return the mean of the last log odds; ``None`` where there is no belief to go by."""
        if self._is_published or evidence.belief is None:
            return None
        since_ns = evidence.now_ns - _ns(self._settings.range.steady_s)
        self._believed.append((evidence.now_ns, evidence.belief.log_odds))
        while self._believed[0][0] < min(since_ns + 1, evidence.now_ns):
            self._believed.popleft()
        return fsum(each for _, each in self._believed) / len(self._believed)

    def _is_near(self, heard: Summary, log_odds: float | None) -> bool:
        settings = self._settings
        if log_odds is None:
            return (
                heard.mean_dbm >= settings.enter_dbm
                and heard.variance_db2 <= settings.enter_variance_db2
            )
        return log_odds >= settings.range.enter_log_odds

    def _is_gone(self, heard: Summary, log_odds: float | None) -> bool:
        settings = self._settings
        if log_odds is None:
            return (
                heard.mean_dbm < settings.leave_dbm
                or heard.variance_db2 > settings.leave_variance_db2
            )
        return log_odds < settings.range.leave_log_odds

    @property
    def _is_published(self) -> bool:
        return self._settings.method == "published"


class ProximityDetector:
    """Keeps what is heard of every responder, and says who comes near, stays and leaves."""

    def __init__(self, settings: ProximitySettings) -> None:
        self._settings = settings
        self._stations: dict[NodeId, tuple[Witness, Stays]] = {}

    def add(self, time_ns: int, responder_id: NodeId, rssi_dbm: float) -> None:
        """Keep a sample. Of several at one time the strongest counts, whichever came first."""
        station = self._stations.get(responder_id)
        if station is None:
            believes = self._settings.method == "likelihood"
            station = (
                Witness(self._settings, believes=believes),
                Stays(responder_id, self._settings),
            )
            self._stations[responder_id] = station
        station[0].add(time_ns, rssi_dbm)

    def tick(self, now_ns: int) -> list[Proximity]:
        """Return what there is to tell, by responder. ``now_ns`` must not go back."""
        told = [
            stays.decide(witness.testify(now_ns))
            for _, (witness, stays) in sorted(self._stations.items())
        ]
        self._stations = {
            responder_id: (witness, stays)
            for responder_id, (witness, stays) in self._stations.items()
            if stays.is_near or witness.remembers(now_ns)
        }
        return [proximity for proximity in told if proximity is not None]


def _ns(duration_s: float) -> int:
    return round(duration_s * NS_PER_S)
