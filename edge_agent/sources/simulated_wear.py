"""A simulated walker's sensor, by how it is worn."""

from __future__ import annotations

import numpy as np

from edge_agent.evaluation.course_truth import StepCount, Waypoints
from edge_agent.evaluation.truth import Array
from edge_agent.sources.recording import SourceError
from shared.maths.rotations import Quaternion
from shared.messages import Mount, NodeId
from shared.simulation.boot_imu import simulate_boot_imu
from shared.simulation.inertial_reading import ImuRecording
from shared.simulation.scenario import Scenario
from shared.simulation.torso_imu import Worn, simulate_torso_imu
from shared.simulation.walker import Walk

PHONE_UPRIGHT: Quaternion = (0.5, 0.5, 0.5, -0.5)
"""From the trunk (forward, right, down) to a phone's axes (right, up along the screen, out of it):
it hangs upright, its screen to the chest."""

_ON_THE_TRUNK: dict[Mount, Worn] = {
    "chest": Worn("chest", PHONE_UPRIGHT),
    "waist": Worn("belt"),
}
SIMULATED_MOUNTS: tuple[Mount, ...] = ("boot", *_ON_THE_TRUNK)

WAYPOINTS_APART_S = 1.0
STEPS_A_STRIDE = 2


def refuse_unsimulated(mount: Mount) -> None:
    """Raise ``SourceError`` for a ``mount`` that no scenario can be walked with."""
    if mount not in SIMULATED_MOUNTS:
        there = ", ".join(SIMULATED_MOUNTS)
        raise SourceError(f"simulated: no sensor worn as {mount}; there are {there}")


def simulate_worn(
    scenario: Scenario, responder_id: NodeId, seed: int, mount: Mount
) -> ImuRecording:
    """Return what the sensor of ``responder_id`` reads; raise as :func:`refuse_unsimulated`."""
    refuse_unsimulated(mount)
    if mount == "boot":
        return simulate_boot_imu(scenario, responder_id, seed)
    return simulate_torso_imu(scenario, responder_id, seed, _ON_THE_TRUNK[mount])


def true_position_m(walk: Walk, mount: Mount, time_s: Array) -> Array:
    """Return where the wearer really is (n, 3), NED: a boot's own place, else the body's."""
    return walk.foot.pose(time_s)[0] if mount == "boot" else walk.body.at(time_s)[0]


def truth_of_trunk(walk: Walk) -> Waypoints:
    """Return where the body was, every second, and the steps of both feet."""
    begin_s, end_s = walk.body.time_s[[0, -1]]
    time_s = np.append(np.arange(begin_s, end_s, WAYPOINTS_APART_S), end_s)
    stepped = np.array([gait not in ("lift", "stand") for gait in walk.gaits], dtype=np.float64)
    counted = np.append(0.0, STEPS_A_STRIDE * np.cumsum(stepped))
    steps = StepCount(np.append(begin_s, walk.reached_s[1:]), counted)
    return Waypoints(time_s, walk.body.at(time_s)[0][:, :2], steps)
