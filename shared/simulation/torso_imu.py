"""What a sensor on a responder's trunk reads: a unit on the belt, a phone at the chest."""

from __future__ import annotations

from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from shared.maths.rotations import IDENTITY, Quaternion, to_matrix
from shared.messages import NodeId
from shared.simulation.chance import generator
from shared.simulation.gaits import StrideShape
from shared.simulation.imu_errors import draw_sensor
from shared.simulation.inertial_reading import ImuRecording, Strikes, read_motion
from shared.simulation.magnetic import MagneticField
from shared.simulation.scenario import Scenario
from shared.simulation.torso_path import TorsoPlace, torso_path
from shared.simulation.walker import Walk, simulate_walk

Array: TypeAlias = NDArray[np.float64]
Vector3: TypeAlias = tuple[float, float, float]

STRIKE_SHARE = {"belt": 0.3, "chest": 0.2}
"""What the body leaves of a heel strike on its way up."""


class Slip(NamedTuple):
    """The sensor turns against the trunk by a rotation vector, in its own axes, from ``at_s``."""

    at_s: float
    rotation_rad: Vector3
    lasts_s: float = 0.4


class Worn(NamedTuple):
    """Where the sensor is worn, how it is turned against the trunk, and when it slips.

    The trunk's axes are forward-right-down; ``sensor_from_trunk`` says (w, x, y, z) how the sensor
    was put on. ``slips`` come one after another.
    """

    place: TorsoPlace
    sensor_from_trunk: Quaternion = IDENTITY
    slips: tuple[Slip, ...] = ()

    def reads(self, time_s: Array, force: Array, rate: Array) -> tuple[Array, Array]:
        """Return forces and rates (n, 3) of the trunk as the sensor sees them at ``time_s``."""
        put_on = np.array(to_matrix(self.sensor_from_trunk)).T
        force, rate = force @ put_on, rate @ put_on
        for slip in self.slips:
            share = np.clip((time_s - slip.at_s) / slip.lasts_s, 0.0, 1.0)
            turning = share > 0.0
            turn = share[turning] ** 2 * (3.0 - 2.0 * share[turning])
            speed = 6.0 * share[turning] * (1.0 - share[turning]) / slip.lasts_s
            vector = np.array(slip.rotation_rad)
            force[turning] = _seen_turned(force[turning], vector, turn)
            rate[turning] = _seen_turned(rate[turning], vector, turn) + speed[:, None] * vector
        return force, rate


def simulate_torso_imu(
    scenario: Scenario, responder_id: NodeId, seed: int, worn: Worn
) -> ImuRecording:
    """Return what a sensor worn so by ``responder_id`` reads in the exercise of ``seed``.

    Times are true ones since the exercise's start; axes are the sensor's.
    """
    walk = simulate_walk(scenario, responder_id, seed)
    chance = generator(seed, "torso_imu", worn.place, responder_id)
    settings = scenario.phone if worn.place == "chest" else scenario.imu
    sensor = draw_sensor(settings, chance)
    path = torso_path(walk, worn.place, chance)
    share = STRIKE_SHARE[worn.place] * sensor.settings.ringing
    field = MagneticField(scenario.magnetic, generator(seed, "magnetic"))
    start_s, end_s = walk.body.time_s[[0, -1]]
    strikes = _strikes_of_both(walk, share)
    return read_motion(path, start_s, end_s, sensor, strikes, field, chance, worn.reads)


def _strikes_of_both(walk: Walk, share: float) -> Strikes:
    """The left foot strikes half a stride from the right one."""
    shape = StrideShape(*walk.foot.shape)
    right_s = walk.foot.start_s + shape.touch * walk.foot.duration_s
    left_s = right_s - 0.5 * walk.foot.duration_s
    strength = np.tile(share * shape.strike_m_s2, 2)
    time_s = np.concatenate([right_s, left_s])
    order = np.argsort(time_s, kind="stable")
    return Strikes(time_s[order], strength[order])


def _seen_turned(vectors: Array, rotation_rad: Array, share: Array) -> Array:
    """Return vectors (n, 3) as seen from axes turned by shares (n,) of a rotation vector."""
    angle_rad = float(np.linalg.norm(rotation_rad))
    if angle_rad == 0.0:
        return vectors
    axis = rotation_rad / angle_rad
    sine, cosine = np.sin(-angle_rad * share)[:, None], np.cos(-angle_rad * share)[:, None]
    along = (vectors @ axis)[:, None] * axis
    return np.asarray(along + cosine * (vectors - along) + sine * np.cross(axis, vectors))
