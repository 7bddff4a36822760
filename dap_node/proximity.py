"""Who is near the DAP: strong signal of little variance, over a sliding window.

"Indoor location tracking for first responders using data network": RSSI falls with range and its
variance rises with it, so a responder is near while the mean is above one threshold and the
variance below another. Both have hysteresis here, and a stay a least length. Only nearness is
told, never a range.

Samples may be lost, late or repeated. They are only kept as they come; every decision is made in
``tick``, from what is then in the window, so that their order of arrival does not matter.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal, NamedTuple, TypeAlias

import msgspec
from msgspec import Meta

from shared.messages import NodeId
from shared.rssi_window import Readings, Summary, sum_up
from shared.units import NS_PER_S

Dbm: TypeAlias = Annotated[float, Meta(ge=-200.0, le=100.0)]
Variance: TypeAlias = Annotated[float, Meta(gt=0.0, le=1e4)]
Duration: TypeAlias = Annotated[float, Meta(gt=0.0, le=60.0)]
Phase: TypeAlias = Literal["entered", "near", "left"]


class ProximitySettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """When a responder counts as near.

    One comes near when the window holds ``least_samples`` with a mean of at least ``enter_dbm``
    and a variance of at most ``enter_variance_db2``. One is then near for ``dwell_s`` at least,
    and until the mean is below ``leave_dbm`` or the variance above ``leave_variance_db2``; or until
    nothing has been heard for ``silence_s``. Nearness is told again every ``repeat_s``.
    """

    window_s: Duration = 1.5
    least_samples: Annotated[int, Meta(ge=2, le=1000)] = 4
    enter_dbm: Dbm = -49.0
    leave_dbm: Dbm = -52.0
    enter_variance_db2: Variance = 20.0
    leave_variance_db2: Variance = 30.0
    dwell_s: Duration = 1.0
    silence_s: Duration = 3.0
    repeat_s: Duration = 1.0

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

    ``time_ns`` is the middle of what was heard, where it says most about the place; of a
    responder who has fallen silent it is when that was noticed, and ``heard`` is the last there
    was. Times never go back within a stay.
    """

    time_ns: int
    responder_id: NodeId
    phase: Phase
    heard: Summary


@dataclass
class _Stay:
    """A stay near the DAP: since when, when it was last due to be told, and what was heard last."""

    entered_ns: int
    told_ns: int
    heard: Summary


class ProximityDetector:
    """Keeps a window of every responder heard, and says who comes near, stays and leaves."""

    def __init__(self, settings: ProximitySettings) -> None:
        self._settings = settings
        self._stations: dict[NodeId, _Station] = {}

    def add(self, time_ns: int, responder_id: NodeId, rssi_dbm: float) -> None:
        """Keep a sample. Of several at one time the strongest counts, whichever came first."""
        station = self._stations.setdefault(responder_id, _Station(responder_id, self._settings))
        station.add(time_ns, rssi_dbm)

    def tick(self, now_ns: int) -> list[Proximity]:
        """Return what there is to tell, by responder. ``now_ns`` must not go back."""
        told = [station.tick(now_ns) for _, station in sorted(self._stations.items())]
        self._stations = {
            responder_id: station
            for responder_id, station in self._stations.items()
            if not station.is_empty
        }
        return [proximity for proximity in told if proximity is not None]


class _Station:
    """One responder: the samples in the window, and the stay near the DAP if there is one."""

    def __init__(self, responder_id: NodeId, settings: ProximitySettings) -> None:
        self._responder_id = responder_id
        self._settings = settings
        self._readings = Readings()
        self._last_heard_ns = 0
        self._stay: _Stay | None = None

    @property
    def is_empty(self) -> bool:
        """Whether there is nothing to remember."""
        return not self._readings and self._stay is None

    def add(self, time_ns: int, rssi_dbm: float) -> None:
        """Keep a sample; of several at one time the strongest."""
        self._readings.add(time_ns, rssi_dbm)

    def tick(self, now_ns: int) -> Proximity | None:
        """Return what there is to tell."""
        heard = self._heard(now_ns)
        if self._stay is not None:
            return self._tell_of(self._stay, heard, now_ns)
        if heard is None or not self._is_near(heard):
            return None
        self._stay = _Stay(entered_ns=now_ns, told_ns=now_ns, heard=heard)
        return Proximity(heard.time_ns, self._responder_id, "entered", heard)

    def _tell_of(self, stay: _Stay, heard: Summary | None, now_ns: int) -> Proximity | None:
        """Return what there is to tell of a stay, having ended it if it is over."""
        if now_ns - self._last_heard_ns >= _ns(self._settings.silence_s):
            self._stay = None
            return Proximity(now_ns, self._responder_id, "left", stay.heard)
        # A late sample may bring the middle of the window back.
        if heard is None or heard.time_ns < stay.heard.time_ns:
            return None
        stay.heard = heard
        if self._is_gone(heard) and now_ns - stay.entered_ns >= _ns(self._settings.dwell_s):
            self._stay = None
            return Proximity(heard.time_ns, self._responder_id, "left", heard)
        repeat_ns = _ns(self._settings.repeat_s)
        if now_ns - stay.told_ns >= repeat_ns:
            # Counted from the beginning, so that scans between seconds do not stretch the period.
            stay.told_ns = now_ns - (now_ns - stay.entered_ns) % repeat_ns
            return Proximity(heard.time_ns, self._responder_id, "near", heard)
        return None

    def _heard(self, now_ns: int) -> Summary | None:
        """Sum up the window that ends now; ``None`` if it holds too few samples.

        Samples are forgotten once they are too old, and wait while they are from the future.
        """
        since_ns = now_ns - _ns(self._settings.window_s)
        self._readings.forget_until(since_ns)
        due = self._readings.between(since_ns, now_ns)
        if due:
            self._last_heard_ns = max(due)
        return sum_up(due) if len(due) >= self._settings.least_samples else None

    def _is_near(self, heard: Summary) -> bool:
        return (
            heard.mean_dbm >= self._settings.enter_dbm
            and heard.variance_db2 <= self._settings.enter_variance_db2
        )

    def _is_gone(self, heard: Summary) -> bool:
        return (
            heard.mean_dbm < self._settings.leave_dbm
            or heard.variance_db2 > self._settings.leave_variance_db2
        )


def _ns(duration_s: float) -> int:
    return round(duration_s * NS_PER_S)
