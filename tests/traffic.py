"""Made-up traffic of an incident, for tests: what responders, DAPs and strangers send."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

from shared.codec import Refusal, decode, encode, parse_key
from shared.messages import (
    Alarm,
    Alert,
    AlertRequest,
    Beat,
    ClockSpan,
    ClockStatement,
    Contact,
    DapEstimate,
    DapInstallation,
    DapPeak,
    DapReading,
    DapState,
    DropAdvice,
    ExerciseStart,
    FloorShare,
    HeightFix,
    ImuBatch,
    LocalPosition,
    Mayday,
    MaydayAnswer,
    Message,
    NeighbourHeard,
    NodeHealth,
    OdometryIncrement,
    Order,
    OrderAnswer,
    OrderReply,
    OrderRequest,
    OriginSet,
    OutsideWord,
    PositionFix,
    ProximityEvent,
    Receipt,
    RssiPeak,
    RssiReport,
    SafeUpTo,
    SetDownHere,
    SiteAdvice,
    StationTable,
    StrangerNoticed,
    TrackEstimate,
    TrackStart,
    Truth,
)

START_NS = 1_700_000_000_000_000_000
STRIDE_NS = 1_100_000_000
DELAY_NS = 40_000_000
"""What a message takes to the post."""

_HERE = LocalPosition(north_m=1.5, east_m=-2.0, down_m=0.0, covariance_m2=(0.25, 0.0, 0.25))


class Sent(NamedTuple):
    """A message on its way: when it reaches the post, its key and its bytes."""

    log_time_ns: int
    key: str
    payload: bytes


def key_of(role: str, node_id: str, topic: str) -> str:
    return f"clew/v1/test/{role}/{node_id}/{topic}"


def increment(number: int, d_north_m: float = 0.7) -> OdometryIncrement:
    time_ns = START_NS + number * STRIDE_NS
    return OdometryIncrement(
        event_time_ns=time_ns,
        sequence=number,
        start_time_ns=time_ns - STRIDE_NS,
        d_north_m=d_north_m,
        d_east_m=0.1 * (number % 7),
        d_down_m=0.0,
        d_heading_rad=0.01,
        heading_rad=0.01 * number,
        covariance=(1e-3, 0.0, 0.0, 0.0, 1e-3, 0.0, 0.0, 1e-3, 0.0, 1e-4),
        mount="boot",
    )


def imu_batch(number: int, samples: int = 25, *, with_field: bool = False) -> ImuBatch:
    first_ns = START_NS + number * samples * 10_000_000
    times = tuple(first_ns + index * 10_000_000 for index in range(samples))
    flat = tuple(0.5 * axis + index for index in range(samples) for axis in range(3))
    return ImuBatch(
        event_time_ns=times[-1],
        sequence=number,
        time_ns=times,
        force_m_s2=flat,
        rate_rad_s=tuple(-value for value in flat),
        field_ut=flat if with_field else (),
    )


def one_of_each() -> dict[str, Message]:
    """Return a message of every topic, by topic name."""
    common: dict[str, Any] = {"event_time_ns": START_NS, "sequence": 3}
    return _of_units(common) | _of_daps(common) | _of_places(common) | _of_posts(common)


def _of_units(common: dict[str, Any]) -> dict[str, Message]:
    """Return what responders' units say, by topic name."""
    return {
        "start": TrackStart(
            **common, position=_HERE, heading_sd_rad=0.2, mount="boot", method="entrance"
        ),
        "increment": increment(3),
        "alarm": Alarm(
            **common, kind="fall", phase="alarm", confidence=0.9, reason="impact, then still"
        ),
        "mayday": Mayday(**common, phase="called", called_ns=5, reason="the button was held"),
        "health": NodeHealth(**common, level="warning", findings=("Boot sensor runs slow",)),
        "advice": DropAdvice(**common, urgency=0.8, reason="at a junction", boxes_left=2),
        "imu": imu_batch(3, with_field=True),
        "dap_rssi": DapReading(**common, dap_id="d1", rssi_dbm=-58.0),
        "dap_peak": DapPeak(**common, dap_id="d1", peak_dbm=-44.0, width_s=1.4, sample_count=11),
        "contact": Contact(**common, other_id="r2", peak_dbm=-50.0, width_s=2.0, sample_count=9),
        "state": DapState(**common, battery_share=0.4, temperature_c=41.5, going=None),
        "beat": Beat(
            **common,
            run="00ff" * 4,
            last_number=9,
            kept_from=1,
            acknowledged=7,
            clock=ClockStatement(
                post_id="p",
                offset_ns=-5,
                uncertainty_ns=2,
                drift=1e-4,
                spans=(ClockSpan(first_number=1, offset_ns=-7, uncertainty_ns=4),),
            ),
        ),
        "order_reply": OrderReply(**common, post_id="p", order_sequence=2, stage="received"),
    }


def _of_daps(common: dict[str, Any]) -> dict[str, Message]:
    """Return what DAPs say and are told, by topic name."""
    return {
        "rssi": RssiReport(**common, responder_id="r1", rssi_dbm=-61.0),
        "proximity": ProximityEvent(
            **common,
            responder_id="r1",
            phase="entered",
            rssi_mean_dbm=-55.5,
            rssi_variance_db2=4.0,
            sample_count=20,
        ),
        "peak": RssiPeak(**common, responder_id="r1", peak_dbm=-43.0, width_s=1.2, sample_count=18),
        "neighbour": NeighbourHeard(
            **common, dap_id="d2", rssi_mean_dbm=-63.0, rssi_variance_db2=2.0, sample_count=25
        ),
        "installation": DapInstallation(**common, installer_id="r1", position=None),
        "set_down": SetDownHere(**common, dap_id="d1", position=_HERE),
        "stations": StationTable(
            **common, responders=(("02:00:5e:10:00:01", "r1"),), daps=(("02:00:5e:10:00:09", "d1"),)
        ),
    }


def _of_places(common: dict[str, Any]) -> dict[str, Message]:
    """Return what is said of places, by topic name."""
    return {
        "site": SiteAdvice(**common, responder_id="r1", reason="passed 6 times by 3"),
        "fix": PositionFix(**common, responder_id="r1", source="commander", position=_HERE),
        "height_fix": HeightFix(**common, node="dap", node_id="d1", down_m=-3.0, sd_m=0.3),
        "track": TrackEstimate(
            **common,
            responder_id="r1",
            north_m=1.0,
            east_m=2.0,
            down_m=0.0,
            covariance_m2=(1.0, 0.0, 1.0),
            heading_rad=0.5,
            heading_sd_rad=0.1,
            last_proximity_time_ns=None,
            down_sd_m=0.4,
            regions_m=(((0.0, 0.0), (0.0, 2.0), (2.0, 2.0)),),
            floors=(FloorShare(0.0, 0.98),),
            status="dead_reckoning",
            reason="no DAP heard for 40 s",
        ),
        "dap_place": DapEstimate(**common, dap_id="d1", position=_HERE),
        "origin": OriginSet(
            **common, latitude_deg=37.5, longitude_deg=127.0, height_m=38.0, bearing_deg=12.5
        ),
        "exercise": ExerciseStart(**common, scenario="course", seed=7, speed=10.0),
        "truth": Truth(**common, north_m=1.0, east_m=2.0, down_m=0.0),
    }


def _of_posts(common: dict[str, Any]) -> dict[str, Message]:
    """Return what posts and commanders say, by topic name."""
    return {
        "mayday_answer": MaydayAnswer(
            **common, responder_id="r1", called_ns=5, phase="called", stage="acknowledged", by="c"
        ),
        "receipt": Receipt(
            **common, safe=(SafeUpTo(role="dap", node_id="d1", run="00ff" * 4, number=7),)
        ),
        "order": Order(**common, kind="evacuate", to=("r1",), text="by the north stair"),
        "order_request": OrderRequest(**common, kind="withdraw", to=("r1",), text=""),
        "order_answer": OrderAnswer(
            **common, commander_id="c", request_sequence=2, refusal="nobody", waited_for=("r1",)
        ),
        "alert": Alert(
            **common,
            number=4,
            kind="fall",
            role="responder",
            node_id="r1",
            since_ns=5,
            stage="assigned",
            words="has fallen",
            by="c",
            assigned_to="r2",
        ),
        "alert_request": AlertRequest(**common, number=4, stage="acknowledged", assigned_to=None),
        "outside": OutsideWord(
            **common, kind="marker", uid="u-1", callsign="Engine 5", words="hydrant", position=_HERE
        ),
        "stranger": StrangerNoticed(**common, role="dap", node_id="d1", words="not signed"),
    }


def traffic(strides: int, responders: tuple[str, ...] = ("r1", "r2")) -> Iterator[Sent]:
    """Yield the strides of some responders, and among them what no one can decode."""
    for number in range(strides):
        stride = increment(number)
        heard_ns = stride.event_time_ns + DELAY_NS
        for responder in responders:
            yield Sent(heard_ns, key_of("responder", responder, "increment"), encode(stride))
        if number % 5 == 2:
            yield Sent(heard_ns, key_of("responder", "r1", "increment"), b"\xc1 no MessagePack")
            yield Sent(heard_ns + 1, "clew/v9/test/responder/r1/increment", encode(stride))
            yield Sent(heard_ns + 2, "elsewhere/ü", b"")


class Tally:
    """A stand-in for the incident: adds strides up, and says each sum one call late.

    ``stride_scale`` is its one setting.
    """

    def __init__(self, stride_scale: float = 1.0) -> None:
        self._stride_scale = stride_scale
        self._north_m: dict[str, float] = {}
        self._held: list[Sent] = []
        self._said = 0

    def handle(self, key: str, payload: bytes, now_ns: int) -> list[Sent]:
        """Add up; return what was held back."""
        due, self._held = self._held, []
        parsed = parse_key(key)
        if isinstance(parsed, Refusal):
            return due
        message = decode(parsed, payload)
        if isinstance(message, OdometryIncrement):
            north_m = self._north_m.get(parsed.node_id, 0.0)
            north_m += message.d_north_m * self._stride_scale
            self._north_m[parsed.node_id] = north_m
            self._held.append(self._estimate(parsed.node_id, now_ns))
        return due

    def pass_time(self, now_ns: int) -> list[Sent]:  # noqa: ARG002
        """Nothing becomes due by itself."""
        return []

    def finish(self, now_ns: int) -> list[Sent]:
        """Return what was held back, and where each responder is in the end."""
        due, self._held = self._held, []
        return due + [self._estimate(responder, now_ns) for responder in self._north_m]

    def _estimate(self, responder: str, now_ns: int) -> Sent:
        estimate = TrackEstimate(
            event_time_ns=now_ns,
            sequence=self._said,
            responder_id=responder,
            north_m=self._north_m[responder],
            east_m=0.0,
            down_m=0.0,
            covariance_m2=(1.0, 0.0, 1.0),
            heading_rad=0.0,
            heading_sd_rad=0.1,
            last_proximity_time_ns=None,
            down_sd_m=0.4,
            regions_m=(((0.0, 0.0), (0.0, 2.0), (2.0, 2.0)),),
            floors=(FloorShare(0.0, 0.98),),
            status="dead_reckoning",
            reason="no DAP heard for 40 s",
        )
        self._said += 1
        return Sent(now_ns, key_of("post", "post", "track"), encode(estimate))
