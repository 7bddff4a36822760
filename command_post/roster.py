"""Who is where, and how sure that is (pure): what is shown of an incident at one moment."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Annotated, Literal, NamedTuple, TypeAlias

import msgspec
from msgspec import Meta

from command_post.confidence import radii95_m
from command_post.fusion.dap_map import InstalledDap
from command_post.fusion.track import Estimate
from command_post.incident import Incident
from shared.messages import LocalPosition
from shared.topics import Role
from shared.units import NS_PER_S

ResponderStatus: TypeAlias = Literal["tracking", "dead_reckoning", "lost", "no_track"]
DapStatus: TypeAlias = Literal["installed", "not_installed", "lost"]
Seconds: TypeAlias = Annotated[float, Meta(gt=0.0, le=1e5)]


class RosterSettings(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """How long a DAP ties a track (``tied_s``), and how long silence is no loss (``lost_s``)."""

    tied_s: Seconds = 60.0
    lost_s: Seconds = 10.0


class ResponderRow(NamedTuple):
    """A responder. ``radii95_m`` are the semi-axes of the 95 % ellipse, the longer first.

    Ages are seconds on the post's clock, ``None`` for never. ``position`` is ``None`` for
    ``no_track``: heard, and not started. ``reason`` says in words why ``status`` is what it is.
    """

    responder_id: str
    status: ResponderStatus
    reason: str
    position: LocalPosition | None
    radii95_m: tuple[float, float] | None
    heard_age_s: float | None
    proximity_age_s: float | None


class DapRow(NamedTuple):
    """A DAP; its columns mean what a responder's do. It has no ``position`` until it is placed."""

    dap_id: str
    status: DapStatus
    reason: str
    position: LocalPosition | None
    radii95_m: tuple[float, float] | None
    heard_age_s: float | None
    installer_id: str | None


class Roster(NamedTuple):
    """Everybody and every DAP at ``now_ns``, in the order of their ids."""

    now_ns: int
    responders: tuple[ResponderRow, ...]
    daps: tuple[DapRow, ...]


def make_roster(
    incident: Incident,
    now_ns: int,
    settings: RosterSettings,
    alive: Collection[str] | None = None,
) -> Roster:
    """Return the roster of ``incident`` at ``now_ns``.

    ``alive`` names the nodes that hold a liveliness token; without it, only silence tells that a
    node is lost.
    """
    view = _View(incident.heard_ns, now_ns, settings, alive)
    estimates, daps = incident.estimates, incident.daps
    return Roster(
        now_ns,
        tuple(
            _responder_row(responder_id, estimates.get(responder_id), view)
            for responder_id in sorted(view.heard("responder") | estimates.keys())
        ),
        tuple(
            _dap_row(dap_id, daps.get(dap_id), view)
            for dap_id in sorted(view.heard("dap") | daps.keys())
        ),
    )


class _View(NamedTuple):
    """What a moment's rows are made from."""

    heard_ns: Mapping[tuple[Role, str], int]
    now_ns: int
    settings: RosterSettings
    alive: Collection[str] | None

    def heard(self, role: Role) -> set[str]:
        return {node_id for node_role, node_id in self.heard_ns if node_role == role}

    def age_s(self, time_ns: int | None) -> float | None:
        return None if time_ns is None else max(self.now_ns - time_ns, 0) / NS_PER_S

    def heard_age_s(self, role: Role, node_id: str) -> float | None:
        return self.age_s(self.heard_ns.get((role, node_id)))

    def why_lost(self, role: Role, node_id: str) -> str | None:
        """Say why a node counts as lost, if it does."""
        age_s = self.heard_age_s(role, node_id)
        if self.alive is not None and node_id not in self.alive:
            return "has left the network" + ("" if age_s is None else f", heard {age_s:.0f} s ago")
        if age_s is not None and age_s > self.settings.lost_s:
            return f"nothing heard for {age_s:.0f} s"
        return None


def _responder_row(responder_id: str, estimate: Estimate | None, view: _View) -> ResponderRow:
    tied_age_s = view.age_s(estimate.last_proximity_time_ns) if estimate else None
    status, reason = _responder_status(responder_id, estimate, tied_age_s, view)
    return ResponderRow(
        responder_id=responder_id,
        status=status,
        reason=reason,
        position=estimate.position if estimate else None,
        radii95_m=radii95_m(estimate.covariance_m2) if estimate else None,
        heard_age_s=view.heard_age_s("responder", responder_id),
        proximity_age_s=tied_age_s,
    )


def _responder_status(
    responder_id: str, estimate: Estimate | None, tied_age_s: float | None, view: _View
) -> tuple[ResponderStatus, str]:
    why_lost = view.why_lost("responder", responder_id)
    if why_lost is not None:
        return "lost", why_lost
    if estimate is None:
        return "no_track", "heard, and not started"
    if tied_age_s is None:
        return "dead_reckoning", "no DAP has been near"
    if tied_age_s > view.settings.tied_s:
        return "dead_reckoning", f"no DAP near for {tied_age_s:.0f} s"
    return "tracking", f"a DAP was near {tied_age_s:.0f} s ago"


def _dap_row(dap_id: str, dap: InstalledDap | None, view: _View) -> DapRow:
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
    )
