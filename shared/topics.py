"""The one table of topics, and the keys they live under.

A key is ``clew/v1/{incident}/{role}/{id}/{topic}``: whose message it is can be read off the key,
and one node writes under its own keys only.
"""

from __future__ import annotations

import re
from typing import Literal, NamedTuple, TypeAlias, get_args

from shared.messages import (
    Alarm,
    Alert,
    AlertRequest,
    Beat,
    Contact,
    DapEstimate,
    DapInstallation,
    DapPeak,
    DapReading,
    DapState,
    DropAdvice,
    ExerciseStart,
    HeightFix,
    ImuBatch,
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
    SetDownHere,
    SiteAdvice,
    StationTable,
    StrangerNoticed,
    TrackEstimate,
    TrackStart,
    Truth,
)

WIRE_VERSION = "v1"

Role: TypeAlias = Literal["responder", "dap", "post"]
ROLES: tuple[Role, ...] = get_args(Role)

Priority: TypeAlias = Literal["high", "data", "low"]


class Topic(NamedTuple):
    """One row: what is sent, by whom, how often, how urgently, and whether it is recorded.

    ``rate_hz`` is the rate to expect of one node, 0 for what happens rarely. What is ``journalled``
    is kept by its sender until it is known to have arrived; the rest is only ever said once.
    """

    name: str
    message: type[Message]
    roles: tuple[Role, ...]
    rate_hz: float
    priority: Priority
    recorded: bool
    journalled: bool


TOPICS: dict[str, Topic] = {
    topic.name: topic
    for topic in (
        Topic("start", TrackStart, ("responder",), 0.0, "high", True, True),
        Topic("increment", OdometryIncrement, ("responder",), 1.0, "high", True, True),
        Topic("alarm", Alarm, ("responder",), 0.0, "high", True, True),
        Topic("mayday", Mayday, ("responder",), 0.0, "high", True, True),
        Topic("mayday_answer", MaydayAnswer, ("post",), 0.0, "high", True, False),
        Topic("health", NodeHealth, ("responder",), 0.1, "data", True, False),
        Topic("advice", DropAdvice, ("responder",), 0.0, "data", True, False),
        Topic("site", SiteAdvice, ("post",), 0.0, "data", False, False),
        Topic("imu", ImuBatch, ("responder",), 4.0, "low", True, False),
        Topic("rssi", RssiReport, ("dap",), 20.0, "low", True, False),
        Topic("proximity", ProximityEvent, ("dap",), 1.0, "high", True, True),
        Topic("peak", RssiPeak, ("dap",), 0.0, "high", True, True),
        Topic("dap_rssi", DapReading, ("responder",), 5.0, "low", True, False),
        Topic("dap_peak", DapPeak, ("responder",), 0.0, "high", True, True),
        Topic("neighbour", NeighbourHeard, ("dap",), 0.2, "low", True, False),
        Topic("contact", Contact, ("responder",), 0.0, "high", True, True),
        Topic("fix", PositionFix, ("responder", "post"), 0.0, "high", True, True),
        Topic("height_fix", HeightFix, ("responder", "dap", "post"), 0.0, "high", True, True),
        Topic("installation", DapInstallation, ("dap",), 0.0, "high", True, True),
        Topic("state", DapState, ("dap",), 0.1, "data", True, False),
        Topic("set_down", SetDownHere, ("responder", "post"), 0.0, "high", True, False),
        Topic("stations", StationTable, ("post",), 0.0, "data", True, False),
        Topic("track", TrackEstimate, ("post",), 10.0, "data", True, False),
        Topic("dap_place", DapEstimate, ("post",), 0.0, "data", True, False),
        Topic("beat", Beat, ("responder", "dap", "post"), 2.0, "high", True, False),
        Topic("receipt", Receipt, ("post",), 0.5, "low", False, False),
        Topic("order", Order, ("post",), 0.0, "high", True, True),
        Topic("order_request", OrderRequest, ("post",), 0.0, "high", True, False),
        Topic("order_answer", OrderAnswer, ("post",), 0.0, "high", True, False),
        Topic("order_reply", OrderReply, ("responder",), 0.0, "high", True, True),
        Topic("alert", Alert, ("post",), 0.0, "high", True, False),
        Topic("alert_request", AlertRequest, ("post",), 0.0, "high", True, False),
        Topic("stranger", StrangerNoticed, ("dap", "post"), 0.0, "high", True, False),
        Topic("origin", OriginSet, ("post",), 0.0, "high", True, False),
        Topic("outside", OutsideWord, ("post",), 0.0, "high", True, False),
        Topic("exercise", ExerciseStart, ("post",), 0.0, "high", True, False),
        Topic("truth", Truth, ("responder", "dap"), 2.0, "low", True, False),
    )
}

TOPIC_OF: dict[type[Message], Topic] = {topic.message: topic for topic in TOPICS.values()}
"""The same table by what is sent: no two topics share a type of message."""

_ID = re.compile(r"[A-Za-z0-9_-]{1,32}")


class Key(NamedTuple):
    """A key taken apart. ``topic`` is one of ``TOPICS``."""

    incident: str
    role: Role
    node_id: str
    topic: str

    def __str__(self) -> str:
        return f"clew/{WIRE_VERSION}/{self.incident}/{self.role}/{self.node_id}/{self.topic}"


def everything_of(incident: str) -> str:
    """Key expression for all messages of an incident, of any version, so that none goes unseen."""
    return f"clew/*/{incident}/**"


def alive_key(incident: str, role: Role, node_id: str) -> str:
    """Key of the liveliness token that a node holds while it runs."""
    return f"clew/{WIRE_VERSION}/{incident}/{role}/{node_id}/alive"


def finished_key(incident: str, responder_id: str) -> str:
    """Key of the token that a responder's agent holds once its part of an exercise is over."""
    return f"clew/{WIRE_VERSION}/{incident}/responder/{responder_id}/finished"


def time_key(incident: str, post_id: str) -> str:
    """Key under which a post answers what time it is."""
    return f"clew/{WIRE_VERSION}/{incident}/post/{post_id}/time"


def certificate_key(incident: str, role: str, node_id: str) -> str:
    """Key under which a node shows its certificate to whoever asks, and shows their own."""
    return f"clew/{WIRE_VERSION}/{incident}/{role}/{node_id}/certificate"


def journal_key(incident: str, role: Role, node_id: str) -> str:
    """Key under which a node answers for what is in its journal (``shared.refill``)."""
    return f"clew/{WIRE_VERSION}/{incident}/{role}/{node_id}/journal"


def all_alive_of(incident: str) -> str:
    """Key expression for the liveliness tokens of an incident's nodes."""
    return f"clew/{WIRE_VERSION}/{incident}/*/*/alive"


def is_id(value: str) -> bool:
    """Say whether ``value`` may stand in a key as a name."""
    return _ID.fullmatch(value) is not None


def check_id(value: str, what: str) -> str:
    """Return ``value`` if it may stand in a key, else raise ``ValueError`` that says what may."""
    if not is_id(value):
        raise ValueError(f"{what} {value!r}: use 1 to 32 letters, digits, '-' or '_'")
    return value
