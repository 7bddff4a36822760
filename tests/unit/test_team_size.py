"""A map comes out as large as it is: neither blunt passes nor uneven strides make it smaller."""

from __future__ import annotations

import numpy as np

from command_post.fusion.team.assembly import NO_AXIS
from command_post.fusion.team.log import TeamLog
from command_post.fusion.team.settings import TeamSettings
from command_post.fusion.team.solution import NOTHING
from command_post.fusion.team.solving import solve
from tests.stride_world import at_ns, installation, stride, track_start
from tests.unit.test_team_tracker import peak_at

SETTINGS = TeamSettings(axis=False)
STRIDE_M = 1.2
STRIDES_A_LAP = 30
LAPS = 40
RUNS = 8
PEAK_DBM = -44.0


def apart_m(seed: int) -> float:
    """Return how far two DAPs are found to be apart, set down and passed by one to and fro.

    Each is passed as bluntly as its peaks say.
    """
    chance = np.random.default_rng(seed)
    log = TeamLog()
    log.add_start("r1", track_start(0.0, heading_sd_rad=0.01))
    for lap in range(LAPS):
        way_m = STRIDE_M if lap % 2 == 0 else -STRIDE_M
        for k in range(STRIDES_A_LAP):
            number = lap * STRIDES_A_LAP + k
            log.add_move("r1", stride(2.0 + number, way_m, 0.0, sequence=number))
        for dap_id, after in (("dap1", 5), ("dap2", 25)):
            strides = after if lap % 2 == 0 else STRIDES_A_LAP - after
            time_s = 1.0 + lap * STRIDES_A_LAP + strides
            if lap == 0:
                log.add_dap(dap_id, installation(time_s, "r1"))
            else:
                off_s = SETTINGS.sharpness.sd_at_m(PEAK_DBM) / STRIDE_M * chance.normal()
                log.add_peak(dap_id, peak_at(time_s + off_s, "r1", peak_dbm=PEAK_DBM))
    until_ns = at_ns(3.0 + LAPS * STRIDES_A_LAP)
    solved = solve(log, until_ns, NOTHING, NO_AXIS, SETTINGS, 20)
    assert solved is not None
    north_m = solved.arrow[solved.assembled.place_column(0) :: 2]
    return float(north_m[1] - north_m[0])


def test_blunt_passes_do_not_shrink_the_map() -> None:
    true_m = 20 * STRIDE_M
    found_m = np.array([apart_m(seed) for seed in range(RUNS)])
    assert abs(found_m.mean() / true_m - 1.0) < 0.012
