"""What people at the post order and are alerted to, and what others say there."""

from __future__ import annotations

from typing import Annotated, Literal

from msgspec import Meta

from shared.messages.values import (
    MOST_WORDS,
    AlertKind,
    AlertStage,
    LocalPosition,
    Message,
    NodeId,
    OrderKind,
    Sequence,
    TimeNs,
    Words,
)


class Order(Message, frozen=True, kw_only=True):
    """The post orders responders: those in ``to``, everybody if that is empty.

    It stands until each has acknowledged it. With the key it came under, ``sequence`` names it.
    ``said_ns`` is when the post says it again, on its own clock; ``None`` when it says it first. So
    who hears it can tell it from what somebody kept and says long after.
    """

    kind: OrderKind
    to: Annotated[tuple[NodeId, ...], Meta(max_length=256)]
    text: Annotated[str, Meta(max_length=200)]
    said_ns: TimeNs | None = None


class OrderRequest(Message, frozen=True, kw_only=True):
    """A commander wants the post to order those in ``to`` something, everybody if that is empty.

    To ``withdraw`` is to wait no longer until they acknowledge what they were ordered.
    """

    kind: OrderKind | Literal["withdraw"]
    to: Annotated[tuple[NodeId, ...], Meta(max_length=256)]
    text: Annotated[str, Meta(max_length=200)]


class OrderAnswer(Message, frozen=True, kw_only=True):
    """The post has done what ``commander_id`` requested under that number, or says why not.

    ``waited_for`` are those who are to acknowledge it.
    """

    commander_id: NodeId
    request_sequence: Sequence
    refusal: Annotated[str, Meta(max_length=400)] | None
    waited_for: Annotated[tuple[NodeId, ...], Meta(max_length=4096)]


class OrderReply(Message, frozen=True, kw_only=True):
    """A responder's unit has an order (``received``), or its wearer says so (``acknowledged``)."""

    post_id: NodeId
    order_sequence: Sequence
    stage: Literal["received", "acknowledged"]


class Alert(Message, frozen=True, kw_only=True):
    """How something that the commander is alerted to stands, since ``event_time_ns``.

    ``number`` names it at its post. ``since_ns`` is when it was raised. ``by`` is who brought it
    to its ``stage``, ``None`` for the post itself; ``assigned_to`` whom it was given to.
    """

    number: Sequence
    kind: AlertKind
    role: Literal["responder", "dap", "post"]
    node_id: NodeId
    since_ns: TimeNs
    stage: AlertStage
    words: Annotated[str, Meta(max_length=MOST_WORDS)]
    by: NodeId | None
    assigned_to: NodeId | None


class AlertRequest(Message, frozen=True, kw_only=True):
    """Somebody at the post acknowledges, assigns (to ``assigned_to``) or resolves an alert."""

    number: Sequence
    stage: Literal["acknowledged", "assigned", "resolved"]
    assigned_to: NodeId | None


class MaydayAnswer(Message, frozen=True, kw_only=True):
    """The post has heard a responder's mayday, or its end (``phase``), named by ``called_ns``.

    ``stage`` is how the alert to it stands: ``heard`` as long as nobody has taken it up, else who
    has (``by``) acknowledged or resolved it.
    """

    responder_id: NodeId
    called_ns: TimeNs
    phase: Literal["called", "cancelled"]
    stage: Literal["heard", "acknowledged", "resolved"]
    by: NodeId | None


class StrangerNoticed(Message, frozen=True, kw_only=True):
    """The post's gate turns away what is said in a node's name, and why."""

    role: Literal["responder", "dap", "post"]
    node_id: NodeId
    words: Words


class OutsideWord(Message, frozen=True, kw_only=True):
    """What somebody in another system (TAK) says: a marker on their map, a message, a mayday.

    ``uid`` and ``callsign`` are theirs; ``cancel`` takes a mayday of that ``uid`` back.
    """

    kind: Literal["marker", "message", "mayday", "cancel"]
    uid: Words
    callsign: Words
    words: Annotated[str, Meta(max_length=MOST_WORDS)]
    position: LocalPosition | None


class OriginSet(Message, frozen=True, kw_only=True):
    """Where on the Earth the incident's origin is: somebody says so, or the post that it is so.

    ``height_m`` is above the WGS 84 ellipsoid; ``bearing_deg`` is how far the incident's north, as
    a building's axes may have it, is clockwise of true north.
    """

    latitude_deg: Annotated[float, Meta(ge=-90.0, le=90.0)]
    longitude_deg: Annotated[float, Meta(ge=-180.0, le=180.0)]
    height_m: Annotated[float, Meta(ge=-1e4, le=1e5)]
    bearing_deg: Annotated[float, Meta(ge=-360.0, le=360.0)]

    @property
    def where(self) -> tuple[float, float, float, float]:
        """Latitude, longitude, height and bearing."""
        return self.latitude_deg, self.longitude_deg, self.height_m, self.bearing_deg


class ExerciseStart(Message, frozen=True, kw_only=True):
    """A simulated exercise begins: its clock reads ``event_time_ns`` now and runs at ``speed``."""

    scenario: Annotated[str, Meta(min_length=1, max_length=200)]
    seed: Annotated[int, Meta(ge=0, le=2**63 - 1)]
    speed: Annotated[float, Meta(gt=0.0, le=1e4)]
