"""What the sensor on a responder's boot reads, from the analytic pose of the boot."""

from __future__ import annotations

from dataclasses import replace

from shared.messages import NodeId
from shared.simulation.barometer import read_pressure_pa
from shared.simulation.chance import generator
from shared.simulation.gaits import StrideShape
from shared.simulation.imu_errors import draw_sensor
from shared.simulation.inertial_reading import ImuRecording, Strikes, read_motion
from shared.simulation.magnetic import MagneticField
from shared.simulation.scenario import Scenario
from shared.simulation.walker import simulate_walk


def simulate_boot_imu(scenario: Scenario, responder_id: NodeId, seed: int) -> ImuRecording:
    """Return what the boot sensor of ``responder_id`` reads in the exercise of ``seed``."""
    walk = simulate_walk(scenario, responder_id, seed)
    chance = generator(seed, "boot_imu", responder_id)
    sensor = draw_sensor(scenario.imu, chance)
    start_s, end_s = walk.body.time_s[[0, -1]]
    shape = StrideShape(*walk.foot.shape)
    strikes = Strikes(
        walk.foot.start_s + shape.touch * walk.foot.duration_s,
        sensor.settings.ringing * shape.strike_m_s2,
    )
    field = MagneticField(scenario.magnetic, generator(seed, "magnetic"))
    read = read_motion(walk.foot, start_s, end_s, sensor, strikes, field, chance)
    if scenario.barometer is None:
        return read
    weather = generator(seed, "barometer", responder_id)
    position_m, _ = walk.foot.pose(read.time_s)
    pressure_pa = read_pressure_pa(scenario.barometer, read.time_s, -position_m[:, 2], weather)
    return replace(read, pressure_pa=pressure_pa)
