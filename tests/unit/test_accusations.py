"""What a node is suspected of is what its own passes suggest."""

from __future__ import annotations

from command_post.fusion.team.accusations import Node, against, leaning
from command_post.fusion.team.assembly import NO_AXIS
from command_post.fusion.team.log import TeamLog
from command_post.fusion.team.misfits import by_key, passes_of
from command_post.fusion.team.settings import TeamSettings
from command_post.fusion.team.solution import NOTHING
from command_post.fusion.team.solving import Solved, solve
from shared.messages import Contact
from tests.stride_world import at_ns, installation, stride, track_start
from tests.unit.test_team_tracker import peak_at

SETTINGS = TeamSettings(axis=False)
STRIDE_M = 1.2
LAP_S = 30
LAPS = 8
HEARD_LAPS = 2
DAPS_AT_S = {"dap1": 8, "dap2": 22}


def to_and_fro(log: TeamLog, responder_id: str, begins_s: float, behind_s: float) -> None:
    """Let a responder go 36 m north and back, past two DAPs, on a clock that is behind."""
    log.add_start(responder_id, track_start(begins_s - behind_s, heading_sd_rad=0.01))
    for k in range(LAPS * LAP_S):
        lap, done = divmod(k, LAP_S)
        way_m = -STRIDE_M if lap % 2 else STRIDE_M
        log.add_move(responder_id, stride(begins_s + k + 1 - behind_s, way_m, 0.0, sequence=k))
        for dap_id, at in DAPS_AT_S.items():
            if lap < HEARD_LAPS and (LAP_S - done if lap % 2 else done) == at:
                log.add_peak(dap_id, peak_at(begins_s + k, responder_id))


def solved_with(behind_s: float) -> tuple[TeamLog, Solved, dict[str, Node]]:
    """Solve two who go to and fro, the second on a late clock, and meet by that again and again.

    They come towards each other: by the late one's date the other was not there yet.
    """
    log = TeamLog()
    for dap_id, at in DAPS_AT_S.items():
        log.add_dap(dap_id, installation(0.0, None, (STRIDE_M * at, 0.0)))
    to_and_fro(log, "r1", 2.0, 0.0)
    to_and_fro(log, "r2", 2.0 + LAP_S, behind_s)
    for lap in range(1, LAPS):
        met_s = 2.0 + LAP_S * (lap + 0.5) - behind_s
        log.add_contact(
            "r2",
            Contact(event_time_ns=at_ns(met_s), sequence=lap, other_id="r1", peak_dbm=-40.0,
                    width_s=1.0, sample_count=9),
        )  # fmt: skip
    solved = solve(log, at_ns(350.0), NOTHING, NO_AXIS, SETTINGS, 20)
    assert solved is not None
    chains = solved.assembled.chains
    passes = by_key(passes_of(solved), lambda each: chains[each.chain].responder_id)
    return log, solved, {name: Node("responder", name, own, 9.0) for name, own in passes.items()}


def test_where_two_met_says_nothing_of_whose_clock_is_wrong() -> None:
    log, solved, nodes = solved_with(2.0)
    assert {each.place[0] for each in nodes["r2"].passes} == {"dap", "meeting"}
    suspected = against(log, solved, nodes["r2"], [])
    assert {each.ahead_s for each in suspected if each.kind == "clock"} == {-2.0, -4.0}


def test_whose_way_bent_to_a_wrong_clock_is_pulled_by_all_passes() -> None:
    _, solved, nodes = solved_with(2.0)
    pulled = leaning(list(nodes.values()), solved)
    assert pulled is not None
    assert pulled.node_id == "r2"
    _, solved, nodes = solved_with(0.0)
    assert leaning(list(nodes.values()), solved) is None
