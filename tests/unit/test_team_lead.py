"""How long before its wearer is nearest a radio is loudest is learnt with all else."""

from __future__ import annotations

import numpy as np
import pytest

from command_post.fusion.team.assembly import NO_AXIS
from command_post.fusion.team.graph import LEAD
from command_post.fusion.team.log import TeamLog
from command_post.fusion.team.settings import TeamSettings
from command_post.fusion.team.solution import NOTHING
from command_post.fusion.team.solving import Solved, solve
from tests.stride_world import at_ns, installation, stride, track_start
from tests.unit.test_team_tracker import peak_at

SETTINGS = TeamSettings(axis=False, lead_sd_s=0.5)
STRIDES = 80
STRIDE_M = 1.2
EVERY_S = 1.0
TURNS_BACK = STRIDES // 2


def out_and_back(
    early_s: float, settings: TeamSettings = SETTINGS, *, stands: bool = False
) -> Solved:
    """Solve a way past five DAPs and back, each of them loudest ``early_s`` before the nearest.

    Who ``stands`` stays beside each for so long that it is heard from there.
    """
    log = TeamLog()
    log.add_start("r1", track_start(0.0, heading_sd_rad=0.01))
    time_s, north_m = 1.0, 0.0
    for k in range(STRIDES):
        time_s += EVERY_S
        north_m += STRIDE_M if k < TURNS_BACK else -STRIDE_M
        log.add_move(
            "r1", stride(time_s, STRIDE_M if k < TURNS_BACK else -STRIDE_M, 0.0, sequence=k)
        )
        if k % 4 == 1:
            dap_id = f"dap{round(north_m / STRIDE_M)}"
            if k < TURNS_BACK:
                log.add_dap(dap_id, installation(0.0, None, (north_m, 0.3)))
            time_s += 4.0 if stands else 0.0
            told_s = time_s - 2.0 if stands else time_s
            log.add_peak(dap_id, peak_at(told_s - early_s, "r1", peak_dbm=-40.0))
    solved = solve(log, at_ns(time_s + 1.0), NOTHING, NO_AXIS, settings, 12)
    assert solved is not None
    return solved


@pytest.mark.parametrize("early_s", [-0.4, -0.2, 0.0, 0.2, 0.4])
def test_the_lead_is_found(early_s: float) -> None:
    assert out_and_back(early_s).arrow[LEAD] == pytest.approx(early_s, abs=0.15)


def test_what_leads_pulls_nobody_off_their_way() -> None:
    off_m = np.abs(out_and_back(0.5).pose[:, 0] - out_and_back(0.0).pose[:, 0]).max()
    held = TeamSettings(axis=False, lead_sd_s=1e-3)
    held_off_m = np.abs(out_and_back(0.5, held).pose[:, 0] - out_and_back(0.0, held).pose[:, 0])
    assert off_m < 0.15
    assert held_off_m.max() > 2.0 * off_m


def test_who_stands_tells_nothing_of_it() -> None:
    solved = out_and_back(0.5, stands=True)
    assert abs(solved.arrow[LEAD]) < 0.15
    assert np.isfinite(solved.pose).all()
