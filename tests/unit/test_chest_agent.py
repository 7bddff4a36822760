"""What an agent says of a chest: start, steps and samples, with a gyroscope or without."""

from __future__ import annotations

import pytest

from edge_agent.agent import Agent
from edge_agent.gnss import SpeedReading
from edge_agent.mounts.methods import MountName, make_mount
from edge_agent.mounts.vehicle import VehicleMount
from edge_agent.sources.opening import open_source
from edge_agent.sources.recording import SourceError
from shared.bus.interface import Received
from shared.bus.memory import MemoryNetwork
from shared.messages import (
    WITHOUT_GYRO,
    ImuBatch,
    ImuSample,
    Message,
    OdometryIncrement,
    TrackStart,
)
from shared.sender import Sender
from tests.bouncing_phone import Phone
from tests.heard import message_in


def said_of(samples: list[ImuSample]) -> list[Message]:
    heard: list[Received] = []
    network = MemoryNetwork()
    network.connect().subscribe("clew/**", heard.append)
    sender = Sender(network.connect(), "fire", "responder", "r1")
    agent = Agent(sender, make_mount("chest"), "robust", None, worn="chest")
    for sample in samples:
        agent.take(sample)
    agent.finish()
    return [message_in(received) for received in heard]


@pytest.mark.parametrize("worn", ["chest", "vehicle"])
def test_only_a_vehicle_is_told_what_satellites_say_of_its_speed(worn: MountName) -> None:
    mount = make_mount(worn)
    sender = Sender(MemoryNetwork().connect(), "fire", "responder", "r1")
    Agent(sender, mount, "robust", None, worn=worn).take(SpeedReading(10**18, 17.0, 0.5))
    assert not isinstance(mount, VehicleMount) or mount.speed_m_s == 17.0


@pytest.mark.parametrize("gyro", [True, False])
def test_a_walk_goes_out_as_start_steps_and_samples(gyro: bool) -> None:
    samples = list(Phone(steps=12).samples(10**18))
    if not gyro:
        samples = [ImuSample(one.time_ns, one.force_m_s2, WITHOUT_GYRO) for one in samples]
    said = said_of(samples)
    starts = [message for message in said if isinstance(message, TrackStart)]
    steps = [message for message in said if isinstance(message, OdometryIncrement)]
    assert {start.mount for start in starts} == {step.mount for step in steps} == {"chest"}
    assert starts[0].event_time_ns <= steps[0].start_time_ns
    assert len(steps) == 12
    assert {step.activity for step in steps} == {"walk"}
    assert any(step.d_north_m or step.d_east_m for step in steps) == gyro
    batches = [message for message in said if isinstance(message, ImuBatch)]
    assert sum(len(batch.time_ns) for batch in batches) == len(samples)
    assert any(batch.rate_rad_s for batch in batches) == gyro


def test_a_simulated_chest_can_be_followed() -> None:
    source = open_source("simulated:corridor", "r1", 0, "chest")
    assert source.start is not None
    first = next(reading for reading in source.readings if isinstance(reading, ImuSample))
    # The phone hangs upright: gravity is read along its screen.
    assert first.force_m_s2[1] == pytest.approx(9.81, abs=0.6)


def test_no_vehicle_is_walked() -> None:
    with pytest.raises(SourceError, match="no sensor worn as vehicle"):
        open_source("simulated:corridor", "r1", 0, "vehicle")
