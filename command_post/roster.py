"""Who is where, and how sure that is (pure): what is shown of an incident at one moment."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from typing import Annotated, Literal, NamedTuple, Protocol, TypeAlias

import msgspec
from msgspec import Meta

from command_post.confidence import radii95_m
from command_post.desks.orders import Orders, Unacknowledged
from command_post.fusion.dap_map import InstalledDap
from command_post.fusion.track import Estimate
from command_post.nodes.freshness import Freshness
from command_post.nodes.told import LastMovement, RaisedAlarm
from shared.gate import Turned
from shared.messages import Activity, Alarm, AlarmKind, LocalPosition, NodeHealth, Order, Supplies
from shared.topics import Role
from shared.units import NS_PER_S

ResponderStatus: TypeAlias = Literal["tracking", "dead_reckoning", "lost", "no_track"]
DapStatus: TypeAlias = Literal["installed", "not_installed", "lost"]
Seconds: TypeAlias = Annotated[float, Meta(gt=0.0, le=1e5)]


SURE_ENOUGH = 0.5
"""A less confident activity is not shown."""

_ACTIVITIES: dict[Activity, str] = {
    "stand": "standing",
    "walk": "walking",
    "fast": "walking fast",
    "run": "running",
    "side_step": "stepping aside",
    "crawl": "crawling",
    "stairs_up": "going upstairs",
    "stairs_down": "going downstairs",
    "ladder": "on a ladder",
    "lift": "in a lift",
}


_DOUBTFUL: dict[Turned, str] = {
    "forged": "that it has not signed",
    "unsigned": "without a signature",
    "unsealed": "without a signature",
    "expired": "with an expired certificate",
    "withdrawn": "with a withdrawn key",
}

MOST_AHEAD_NS = 5 * NS_PER_S
"""A clock further ahead than this says nothing about when."""


class RosterSettings(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """How long a DAP ties a track (``tied_s``), and how long silence is no loss (``lost_s``).

    Who has not moved for ``still_s`` stands still.
    """

    tied_s: Seconds = 60.0
    lost_s: Seconds = 10.0
    still_s: Seconds = 5.0


class OrderedRow(NamedTuple):
    """An order that was not acknowledged: how old it is, and whether the unit has it."""

    order: Order
    age_s: float
    received: bool


class ResponderRow(NamedTuple):
    """A responder. ``radii95_m`` are the semi-axes of the 95 % ellipse, the longer first.

    Ages are seconds on the post's clock, ``None`` for never. ``position`` is ``None`` for
    ``no_track``: heard, and not started. ``reason`` says in words why ``status`` is what it is.
    ``alarm`` is the worst that stands, the newest of equals; ``activity`` what they do, in words,
    if that is known now; ``fault`` what is wrong with their unit: its clock, its id, and the worst
    that it finds wrong with its sensor. ``orders`` are those that they have not acknowledged,
    ``supplies`` what they had left when that was told last.
    """

    responder_id: str
    status: ResponderStatus
    reason: str
    position: LocalPosition | None
    radii95_m: tuple[float, float] | None
    heard_age_s: float | None
    proximity_age_s: float | None
    alarm: Alarm | None
    activity: str | None
    fault: str | None
    orders: tuple[OrderedRow, ...] = ()
    supplies: Supplies | None = None


class DapRow(NamedTuple):
    """A DAP; its columns mean what a responder's do. It has no ``position`` until it is placed."""

    dap_id: str
    status: DapStatus
    reason: str
    position: LocalPosition | None
    radii95_m: tuple[float, float] | None
    heard_age_s: float | None
    installer_id: str | None
    fault: str | None
    supplies: Supplies | None = None


class Roster(NamedTuple):
    """Everybody and every DAP at ``now_ns``, by their ids.

    First those with an alarm, and those who have not acknowledged that they are to come out.

    ``nodes`` tells of all nodes how fresh what is known of them is, others than these as well;
    ``remarks`` in words what is wrong with the post itself.
    """

    now_ns: int
    responders: tuple[ResponderRow, ...]
    daps: tuple[DapRow, ...]
    nodes: tuple[Freshness, ...] = ()
    remarks: tuple[str, ...] = ()


class RosterSource(Protocol):
    """What a roster is made of: an incident, or what a recording tells of one.

    Each is as ``command_post.incident.Incident`` has it.
    """

    @property
    def estimates(self) -> Mapping[str, Estimate]:
        """The newest estimate of every responder, by id."""

    @property
    def daps(self) -> Mapping[str, InstalledDap]:
        """The DAPs that stand, by id."""

    @property
    def heard_ns(self) -> Mapping[tuple[Role, str], int]:
        """When each responder and DAP was last heard."""

    @property
    def alarms(self) -> Mapping[str, Mapping[AlarmKind, RaisedAlarm]]:
        """The newest of each kind of alarm, by responder."""

    @property
    def health(self) -> Mapping[str, NodeHealth]:
        """What each responder's unit last said of its sensor."""

    @property
    def movements(self) -> Mapping[str, LastMovement]:
        """The newest movement of each responder."""

    @property
    def supplies(self) -> Mapping[tuple[Role, str], Supplies]:
        """What each node that tells has left."""

    @property
    def orders(self) -> Orders:
        """What has been ordered, and who has not acknowledged it."""

    def faults(self, role: Role, node_id: str, now_ns: int) -> list[str]:
        """Return what is wrong with a node, in words."""


def make_roster(
    incident: RosterSource,
    now_ns: int,
    settings: RosterSettings,
    alive: Collection[tuple[Role, str]] | None = None,
    nodes: tuple[Freshness, ...] = (),
    turned: Mapping[tuple[Turned, str], int] | None = None,
) -> Roster:
    """Return the roster of ``incident`` at ``now_ns``.

    ``alive`` names the nodes that hold a liveliness token; without it, only silence tells that a
    node is lost. ``turned`` counts what was not let in, by reason and node.
    """
    view = _View(incident.heard_ns, now_ns, settings, alive, turned or {})
    estimates, daps = incident.estimates, incident.daps
    responders = [
        _responder_row(responder_id, estimates.get(responder_id), incident, view)
        for responder_id in sorted(view.heard("responder") | estimates.keys())
    ]
    return Roster(
        now_ns,
        tuple(sorted(responders, key=_urgency)),
        tuple(
            _dap_row(dap_id, daps.get(dap_id), incident, view)
            for dap_id in sorted(view.heard("dap") | daps.keys())
        ),
        nodes,
    )


class _View(NamedTuple):
    """What a moment's rows are made from."""

    heard_ns: Mapping[tuple[Role, str], int]
    now_ns: int
    settings: RosterSettings
    alive: Collection[tuple[Role, str]] | None
    turned: Mapping[tuple[Turned, str], int]

    def heard(self, role: Role) -> set[str]:
        return {node_id for node_role, node_id in self.heard_ns if node_role == role}

    def age_s(self, time_ns: int | None) -> float | None:
        return None if time_ns is None else max(self.now_ns - time_ns, 0) / NS_PER_S

    def said_age_s(self, time_ns: int | None) -> float | None:
        """Age of what a node's own clock dates; ``None`` if that clock is ahead, as for never."""
        ahead = time_ns is not None and time_ns > self.now_ns + MOST_AHEAD_NS
        return None if ahead else self.age_s(time_ns)

    def heard_age_s(self, role: Role, node_id: str) -> float | None:
        return self.age_s(self.heard_ns.get((role, node_id)))

    def doubtful(self, node_id: str) -> Iterator[str]:
        """Yield what is said in a node's name, and is not shown to be its word."""
        for why, words in _DOUBTFUL.items():
            count = self.turned.get((why, node_id), 0)
            if count:
                yield f"{count} messages {words} were not let in"

    def why_lost(self, role: Role, node_id: str) -> str | None:
        """Say why a node counts as lost, if it does."""
        age_s = self.heard_age_s(role, node_id)
        if self.alive is not None and (role, node_id) not in self.alive:
            return "has left the network" + ("" if age_s is None else f", heard {age_s:.0f} s ago")
        if age_s is not None and age_s > self.settings.lost_s:
            return f"nothing heard for {age_s:.0f} s"
        return None


def _responder_row(
    responder_id: str, estimate: Estimate | None, incident: RosterSource, view: _View
) -> ResponderRow:
    tied_age_s = view.said_age_s(estimate.last_proximity_time_ns) if estimate else None
    status, reason = _responder_status(responder_id, estimate, tied_age_s, view)
    return ResponderRow(
        responder_id=responder_id,
        status=status,
        reason=reason,
        position=estimate.position if estimate else None,
        radii95_m=radii95_m(estimate.covariance_m2) if estimate else None,
        heard_age_s=view.heard_age_s("responder", responder_id),
        proximity_age_s=tied_age_s,
        alarm=_standing_alarm(incident.alarms.get(responder_id, {})),
        activity=(
            None if status == "lost" else _activity(incident.movements.get(responder_id), view)
        ),
        fault=_fault(
            *incident.faults("responder", responder_id, view.now_ns),
            *view.doubtful(responder_id),
            *_worst(incident.health.get(responder_id)),
        ),
        orders=tuple(_ordered(one, view) for one in incident.orders.of(responder_id)),
        supplies=incident.supplies.get(("responder", responder_id)),
    )


def _urgency(row: ResponderRow) -> tuple[bool, bool]:
    return row.alarm is None, not any(one.order.kind == "evacuate" for one in row.orders)


def _ordered(one: Unacknowledged, view: _View) -> OrderedRow:
    age_ns = max(view.now_ns - one.order.event_time_ns, 0)
    return OrderedRow(one.order, age_ns / NS_PER_S, one.stage == "received")


def _standing_alarm(raised: Mapping[AlarmKind, RaisedAlarm]) -> Alarm | None:
    """Return the worst alarm that is not over, the newest of equals."""
    standing = [one for one in raised.values() if one.alarm.phase != "cancelled"]
    if not standing:
        return None
    return max(standing, key=lambda one: (one.alarm.phase == "alarm", one.heard_ns)).alarm


def _activity(last: LastMovement | None, view: _View) -> str | None:
    if last is None:
        return None
    age_s = view.age_s(last.heard_ns)
    if age_s is not None and age_s > view.settings.still_s:
        return "standing still"
    increment = last.increment
    sure = increment.activity_confidence >= SURE_ENOUGH
    return _ACTIVITIES.get(increment.activity) if sure else None


def _fault(*found: str) -> str | None:
    return "; ".join(found) or None


def _worst(health: NodeHealth | None) -> tuple[str, ...]:
    return () if health is None or health.level == "ok" else health.findings[:1]


def _responder_status(
    responder_id: str, estimate: Estimate | None, tied_age_s: float | None, view: _View
) -> tuple[ResponderStatus, str]:
    why_lost = view.why_lost("responder", responder_id)
    if why_lost is not None:
        heard_age_s = view.heard_age_s("responder", responder_id)
        if tied_age_s is not None and heard_age_s is not None and tied_age_s < heard_age_s:
            why_lost += f", but by a DAP {tied_age_s:.0f} s ago"
        return "lost", why_lost
    if estimate is None:
        return "no_track", "heard, and not started"
    if tied_age_s is None:
        return "dead_reckoning", "no DAP has been near"
    if tied_age_s > view.settings.tied_s:
        return "dead_reckoning", f"no DAP near for {tied_age_s:.0f} s"
    return "tracking", f"a DAP was near {tied_age_s:.0f} s ago"


def _dap_row(dap_id: str, dap: InstalledDap | None, incident: RosterSource, view: _View) -> DapRow:
    why_lost = view.why_lost("dap", dap_id)
    status: DapStatus
    if why_lost is not None:
        status, reason = "lost", why_lost
    elif dap is None:
        status, reason = "not_installed", "heard, and not set down"
    else:
        by = f"set down by {dap.installer_id}" if dap.installer_id else "at a known point"
        status, reason = "installed", by
    return DapRow(
        dap_id=dap_id,
        status=status,
        reason=reason,
        position=dap.position if dap else None,
        radii95_m=radii95_m(dap.position.covariance_m2) if dap else None,
        heard_age_s=view.heard_age_s("dap", dap_id),
        installer_id=dap.installer_id if dap else None,
        fault=_fault(
            *incident.faults("dap", dap_id, view.now_ns),
            *view.doubtful(dap_id),
        ),
        supplies=incident.supplies.get(("dap", dap_id)),
    )
