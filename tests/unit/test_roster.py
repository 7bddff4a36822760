"""The roster: every responder and DAP, with a status and the reason for it."""

from __future__ import annotations

import math

import pytest

from command_post.confidence import radii95_m
from command_post.incident import Incident, IncidentSettings
from command_post.roster import RosterSettings, make_roster
from shared.codec import encode
from shared.messages import Message
from shared.topics import Role
from tests.stride_world import at_ns, installation, key_of, proximity, stride, track_start, truth

SETTINGS = RosterSettings(tied_s=30.0, lost_s=10.0)


def incident_with(*heard: tuple[Role, str, Message]) -> Incident:
    incident = Incident(IncidentSettings())
    for role, node_id, message in heard:
        key = key_of(role, node_id, type(message))
        incident.handle(str(key), encode(message), message.event_time_ns)
    incident.finish(0)
    return incident


@pytest.fixture
def incident() -> Incident:
    return incident_with(
        ("dap", "dap1", installation(0.0, None, (1.0, 0.0))),
        ("dap", "dap2", truth(0.0, (0.0, 0.0))),
        ("responder", "r1", track_start(0.0)),
        ("responder", "r2", track_start(0.0)),
        ("responder", "r3", truth(2.0, (0.0, 0.0))),
        ("dap", "dap1", proximity(1.0, "r1")),
        ("responder", "r1", stride(2.0, 1.2, 0.0)),
        ("responder", "r2", stride(2.0, 1.2, 0.0)),
    )


def test_a_responder_tied_lately_is_tracked(incident: Incident) -> None:
    row = make_roster(incident, at_ns(5.0), SETTINGS).responders[0]
    assert (row.responder_id, row.status) == ("r1", "tracking")
    assert row.reason == "a DAP was near 4 s ago"
    assert row.heard_age_s == pytest.approx(3.0)
    assert row.proximity_age_s == pytest.approx(4.0)
    assert row.position == incident.estimates["r1"].position
    assert row.radii95_m == radii95_m(incident.estimates["r1"].covariance_m2)


def test_without_a_dap_it_is_dead_reckoning(incident: Incident) -> None:
    row = make_roster(incident, at_ns(5.0), SETTINGS).responders[1]
    assert (row.status, row.reason) == ("dead_reckoning", "no DAP has been near")
    assert row.proximity_age_s is None


def test_a_tie_grows_old() -> None:
    late = incident_with(
        ("dap", "dap1", installation(0.0, None, (1.0, 0.0))),
        ("responder", "r1", track_start(0.0)),
        ("dap", "dap1", proximity(1.0, "r1")),
        ("responder", "r1", stride(41.0, 1.2, 0.0)),
    )
    (row,) = make_roster(late, at_ns(42.0), SETTINGS).responders
    assert (row.status, row.reason) == ("dead_reckoning", "no DAP near for 41 s")


def test_silence_is_loss(incident: Incident) -> None:
    rows = make_roster(incident, at_ns(13.0), SETTINGS).responders
    assert {row.status for row in rows} == {"lost"}
    assert rows[0].reason == "nothing heard for 11 s"
    assert rows[0].position is not None


def test_who_is_silent_may_still_be_heard_by_a_dap() -> None:
    late = incident_with(
        ("dap", "dap1", installation(0.0, None, (9.0, 0.0))),
        ("responder", "r1", track_start(0.0)),
        ("responder", "r2", track_start(0.0)),
        ("responder", "r1", stride(2.0, 1.2, 0.0)),
        ("dap", "dap1", proximity(30.0, "r1")),
        ("responder", "r2", stride(34.0, 1.2, 0.0)),
    )
    row, _ = make_roster(late, at_ns(36.0), SETTINGS).responders
    assert row.status == "lost"
    assert row.reason == "nothing heard for 34 s, but by a DAP 6 s ago"


def test_leaving_the_network_is_loss_at_once(incident: Incident) -> None:
    alive: set[tuple[Role, str]] = {("responder", "r1"), ("dap", "dap1"), ("dap", "r2")}
    rows = make_roster(incident, at_ns(5.0), SETTINGS, alive=alive)
    assert [row.status for row in rows.responders] == ["tracking", "lost", "lost"]
    assert rows.responders[1].reason == "has left the network, heard 3 s ago"
    assert [row.status for row in rows.daps] == ["installed", "lost"]


def test_who_is_heard_and_has_not_started_is_listed(incident: Incident) -> None:
    row = make_roster(incident, at_ns(5.0), SETTINGS).responders[2]
    assert (row.responder_id, row.status) == ("r3", "no_track")
    assert row.position is None
    assert row.radii95_m is None


def test_daps_are_listed(incident: Incident) -> None:
    first, second = make_roster(incident, at_ns(5.0), SETTINGS).daps
    assert (first.dap_id, first.status, first.reason) == ("dap1", "installed", "at a known point")
    assert first.radii95_m == pytest.approx((0.245, 0.245), abs=0.001)
    assert (second.dap_id, second.status, second.position) == ("dap2", "not_installed", None)


def test_radii_are_the_ellipses_axes() -> None:
    scale = math.sqrt(5.991464547)
    assert radii95_m((4.0, 0.0, 9.0)) == pytest.approx((3.0 * scale, 2.0 * scale))
    assert radii95_m((2.0, 1.0, 2.0)) == pytest.approx((math.sqrt(3.0) * scale, scale))
    assert radii95_m((1.0, 1.0, 1.0)) == pytest.approx((math.sqrt(2.0) * scale, 0.0))
