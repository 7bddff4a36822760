"""The map: who is placed where, and what no later word can move."""

from __future__ import annotations

from command_post.fusion.dap_map import DapMap
from shared.messages import LocalPosition
from tests.stride_world import at_ns, installation

INSTALLER_AT = LocalPosition(north_m=7.0, east_m=3.0, down_m=-1.0, covariance_m2=(2.0, 0.0, 1.0))


def installer_known(responder_id: str, time_ns: int) -> LocalPosition | None:
    return INSTALLER_AT if (responder_id, time_ns) == ("r1", at_ns(20.0)) else None


def test_a_told_position_is_taken_as_it_is() -> None:
    daps = DapMap()
    told = installation(20.0, "r1", (1.0, 2.0))
    assert daps.install("dap2", told, installer_known) == "placed"
    assert daps["dap2"].position is told.position


def test_without_a_position_it_stands_where_its_installer_stood() -> None:
    daps = DapMap()
    assert daps.install("dap2", installation(20.0, "r1"), installer_known) == "placed"
    assert daps["dap2"] == (INSTALLER_AT, at_ns(20.0), "r1")


def test_nobody_knows_where() -> None:
    daps = DapMap()
    assert daps.install("dap2", installation(20.0, "r9"), installer_known) == "unplaced"
    assert daps.install("dap3", installation(20.0, None), installer_known) == "taken_up"
    assert len(daps) == 0


def test_the_same_installation_said_again_changes_nothing() -> None:
    daps = DapMap()
    daps.install("dap2", installation(20.0, "r1"), installer_known)
    again = installation(20.0, "r1", (50.0, 50.0), sequence=1)
    assert daps.install("dap2", again, installer_known) == "repeated"
    assert daps["dap2"].position == INSTALLER_AT


def test_a_newer_installation_replaces_and_an_older_does_not() -> None:
    daps = DapMap()
    daps.install("dap2", installation(20.0, "r1"), installer_known)
    newer = installation(30.0, "r2", (9.0, 9.0))
    assert daps.install("dap2", newer, installer_known) == "placed"
    assert daps.install("dap2", installation(20.0, "r1"), installer_known) == "superseded"
    assert daps["dap2"].position == newer.position


def test_an_unplaced_reinstallation_leaves_the_dap_where_it_stood() -> None:
    daps = DapMap()
    daps.install("dap2", installation(20.0, "r1"), installer_known)
    assert daps.install("dap2", installation(40.0, "r1"), installer_known) == "unplaced"
    assert daps["dap2"].position == INSTALLER_AT
