"""The agent's shell: what goes out for what comes in."""

from __future__ import annotations

import math
import sys
from collections.abc import Iterable, Iterator
from types import FrameType

import msgspec
import pytest
from structlog.testing import capture_logs

from edge_agent.__main__ import app
from edge_agent.agent import NOT_KEPT, Agent
from edge_agent.following import tell_losses
from edge_agent.mounts.interface import Faults
from edge_agent.mounts.methods import make_mount
from edge_agent.sources.opening import open_source
from edge_agent.sources.reading import TruePlace
from edge_agent.sources.recording import SourceError
from shared.bus.interface import Received
from shared.bus.memory import MemoryNetwork
from shared.messages import (
    Alarm,
    Contact,
    ImuBatch,
    ImuSample,
    LocalPosition,
    Message,
    NodeHealth,
    OdometryIncrement,
    PositionFix,
    TrackStart,
    Truth,
    Vector3,
)
from shared.process import ExitCode
from shared.sender import Sender
from shared.simulation.barometer import BarometerSettings
from shared.simulation.boot_imu import simulate_boot_imu
from shared.simulation.legs import Move, Ride, Stand
from tests.heard import message_in
from tests.simulated_walks import lone_walk
from tests.synthetic_boot import SyntheticWalk

CORRIDOR = "corridor"
HERE = LocalPosition(north_m=1.0, east_m=2.0, down_m=0.0, covariance_m2=(1.0, 0.0, 1.0))


@pytest.fixture
def heard() -> list[Received]:
    return []


@pytest.fixture
def agent(heard: list[Received]) -> Agent:
    network = MemoryNetwork()
    network.connect().subscribe("clew/**", heard.append)
    sender = Sender(network.connect(), "fire", "responder", "r1")
    return Agent(sender, make_mount("boot", "linear"), "linear", None)


def messages(heard: list[Received]) -> Iterator[Message]:
    return map(message_in, heard)


def walk(agent: Agent) -> list[ImuSample]:
    """Let ``agent`` follow r1 of the corridor scenario; return the samples it was given."""
    readings = list(open_source(f"simulated:{CORRIDOR}", "r1", 3).beginning_at(10**18))
    for reading in readings:
        agent.take(reading)
    agent.finish()
    return [reading for reading in readings if isinstance(reading, ImuSample)]


def test_a_walk_goes_out_as_start_strides_samples_and_truth(
    agent: Agent, heard: list[Received]
) -> None:
    samples = walk(agent)
    said = list(messages(heard))
    starts = [m for m in said if isinstance(m, TrackStart)]
    strides = [m for m in said if isinstance(m, OdometryIncrement)]
    assert starts
    assert starts[0].position is None
    assert starts[-1].event_time_ns <= strides[0].start_time_ns
    assert agent.start_payload == [r.payload for r in heard if r.key.endswith("/start")][-1]
    walked_m = sum(math.hypot(m.d_north_m, m.d_east_m) for m in strides)
    true = [m for m in said if isinstance(m, Truth)]
    straight_m = math.hypot(true[-1].north_m - true[0].north_m, true[-1].east_m - true[0].east_m)
    assert walked_m == pytest.approx(straight_m, rel=0.05)
    batches = [m for m in said if isinstance(m, ImuBatch)]
    assert [time for batch in batches for time in batch.time_ns] == [s.time_ns for s in samples]
    flat = [value for batch in batches for value in batch.force_m_s2]
    assert flat == [value for sample in samples for value in sample.force_m_s2]


@pytest.mark.parametrize(
    ("shaken", "samples", "why"),
    [
        (0.0, 0, "no sample came"),
        (1.0, 500, "the boot was never still"),
        (0.0, 500, "no step was found"),
    ],
)
def test_an_agent_that_told_no_movement_knows_why(
    agent: Agent, shaken: float, samples: int, why: str
) -> None:
    for index in range(samples):
        shake = shaken * math.sin(index)
        rate_rad_s, force_m_s2 = (5.0 * shake, 0.0, 0.0), (0.0, 0.0, -9.81 + 8.0 * shake)
        agent.take(ImuSample(10**18 + index * 10_000_000, force_m_s2, rate_rad_s))
    agent.finish()
    assert agent.why_no_movement is not None
    assert agent.why_no_movement.startswith(why)
    with capture_logs() as logs:
        tell_losses(agent, Faults(), 0)
    assert [log["event"] for log in logs] == ["no movement was told"]


def test_an_agent_that_told_movement_has_nothing_to_say(agent: Agent) -> None:
    walk(agent)
    assert agent.why_no_movement is None


def test_each_key_is_numbered_from_nought(agent: Agent, heard: list[Received]) -> None:
    walk(agent)
    for topic in ("increment", "imu", "truth"):
        under = [r for r in heard if r.key == f"clew/v1/fire/responder/r1/{topic}"]
        assert [m.sequence for m in messages(under)] == list(range(len(under)))


def test_a_sample_that_is_no_number_is_kept_out_of_the_record(
    agent: Agent, heard: list[Received]
) -> None:
    for index in range(200):
        force = math.nan if index % 10 == 0 else -9.81
        agent.take(ImuSample(10**18 + index * 10_000_000, (0.0, 0.0, force), (0.0, 0.0, 0.0)))
    agent.finish()
    batches = [m for m in messages(heard) if isinstance(m, ImuBatch)]
    assert sum(len(batch.time_ns) for batch in batches) == 180


def test_pressures_are_recorded_at_their_samples_and_what_is_none_is_not(
    agent: Agent, heard: list[Received]
) -> None:
    readings = {3: 101_325.0, 9: math.nan, 12: -1.0, 30: math.inf, 31: 0.0}
    for index in range(40):
        time_ns = 10**18 + index * 10_000_000
        still = ImuSample(time_ns, (0.0, 0.0, -9.81), (0.0, 0.0, 0.0), None, readings.get(index))
        agent.take(still)
    agent.finish()
    batches = [m for m in messages(heard) if isinstance(m, ImuBatch)]
    assert len(batches) == 2
    told = [
        (batch.time_ns[row], pressure_pa)
        for batch in batches
        for row, pressure_pa in zip(batch.pressure_rows, batch.pressure_pa, strict=True)
    ]
    assert told == [(10**18 + 30_000_000, 101_325.0), (10**18 + 310_000_000, 0.0)]


def test_strides_say_what_they_were(agent: Agent, heard: list[Received]) -> None:
    walk(agent)
    strides = [m for m in messages(heard) if isinstance(m, OdometryIncrement)]
    walking = [m for m in strides if m.activity == "walk"]
    assert len(walking) > 0.8 * len(strides)
    assert all(m.activity_confidence > 0.5 for m in walking)


def test_how_the_sensor_is_worn_is_learnt_and_told(heard: list[Received]) -> None:
    network = MemoryNetwork()
    network.connect().subscribe("clew/**", heard.append)
    sender = Sender(network.connect(), "fire", "responder", "r1")
    walk(Agent(sender, make_mount("boot", "eskf"), "eskf", None))
    said = list(messages(heard))
    sds_rad = [m.facing_sd_rad for m in said if isinstance(m, OdometryIncrement)]
    assert sds_rad[-1] < 0.3 < sds_rad[0]
    findings = {words for m in said if isinstance(m, NodeHealth) for words in m.findings}
    assert "Boot sensor found: its +x axis points forward, its +z axis down" in findings


def still(agent: Agent, from_s: float, to_s: float, rate_rad_s: float = 0.0) -> None:
    for index in range(round(from_s * 100), round(to_s * 100)):
        reading = ImuSample(10**18 + index * 10_000_000, (0.0, 0.0, -9.81), (rate_rad_s, 0.0, 0.0))
        agent.take(reading)


def test_an_alarm_goes_out_at_once_and_again_and_so_does_its_end(
    agent: Agent, heard: list[Received]
) -> None:
    still(agent, 0.0, 41.0)
    still(agent, 41.0, 55.0, rate_rad_s=2.0)
    alarms = [m for m in messages(heard) if isinstance(m, Alarm)]
    assert [m.phase for m in alarms] == [*["pre_alarm"] * 2, *["alarm"] * 3, *["cancelled"] * 3]
    assert [(m.event_time_ns - 10**18) / 1e9 for m in alarms[:5]] == [20.0, 20.0, 30.0, 30.0, 30.0]
    assert [m.sequence for m in alarms] == list(range(8))


def test_a_sample_asks_for_few_calls() -> None:
    """A sample's cost, counted: ten times as many calls would not keep up with a fast sensor."""
    sender = Sender(MemoryNetwork().connect(), "fire", "responder", "r1")
    agent = Agent(sender, make_mount("boot", "eskf"), "eskf", None)
    samples = list(SyntheticWalk(strides=8).samples(200.0))
    calls = 0

    def count(_: FrameType, event: str, __: object) -> None:
        nonlocal calls
        calls += event in ("call", "c_call")

    sys.setprofile(count)
    try:
        for sample in samples:
            agent.take(sample)
    finally:
        sys.setprofile(None)
    assert calls < 60 * len(samples)


def test_a_stream_that_stops_is_a_fault_however_late_it_is_noticed(
    agent: Agent, heard: list[Received]
) -> None:
    still(agent, 0.0, 5.0)
    agent.pass_time(10**18 + 5 * 10**9)
    still(agent, 65.0, 67.0)
    faults = [m for m in messages(heard) if isinstance(m, NodeHealth) and m.level == "fault"]
    stopped = [m for m in faults if "stopped sending" in m.findings[0]]
    assert [m.event_time_ns for m in stopped] == [10**18 + 5_990_000_000]
    assert not [m for m in messages(heard) if isinstance(m, Alarm)]


def test_a_heading_found_late_starts_the_track_anew(agent: Agent, heard: list[Received]) -> None:
    for index in range(400):
        field_ut = None if index < 200 else (20.0, 0.0, 40.0)
        still = ImuSample(10**18 + index * 10_000_000, (0.0, 0.0, -9.81), (0.0, 0.0, 0.0), field_ut)
        agent.take(still)
    sds = [m.heading_sd_rad for m in messages(heard) if isinstance(m, TrackStart)]
    assert len(sds) == 2
    assert sds[1] < sds[0]


def test_a_simulated_source_has_the_truth_and_the_start() -> None:
    source = open_source(f"simulated:{CORRIDOR}", "r2", 0)
    readings = list(source.beginning_at(5 * 10**9))
    times = [reading.time_ns for reading in readings]
    assert times == sorted(times)
    assert times[0] >= 5 * 10**9
    places = [reading for reading in readings if isinstance(reading, TruePlace)]
    assert len(places) == pytest.approx((times[-1] - times[0]) / 1e8, abs=2)
    assert source.start is not None
    assert msgspec.structs.astuple(source.start)[:3] == (0.0, 1.0, 0.0)


@pytest.mark.parametrize(
    ("name", "complaint"),
    [
        ("walk.csv", "use csv:FILE"),
        ("serial:/dev/ttyUSB0", "use csv:FILE"),
        ("csv:", "use csv:FILE"),
        ("csv:/nowhere/walk.csv", "/nowhere/walk.csv"),
        ("npz:/nowhere/walk.npz", "/nowhere/walk.npz"),
        ("mcap:/nowhere/walk.mcap", "/nowhere/walk.mcap"),
        (f"simulated:{CORRIDOR}", "no responder 'r9'; there are r1, r2"),
    ],
)
def test_a_source_that_cannot_be_opened_is_said(name: str, complaint: str) -> None:
    with pytest.raises(SourceError, match=complaint):
        open_source(name, "r9", 0)


def test_whom_the_wearer_meets_is_told(agent: Agent, heard: list[Received]) -> None:
    """Both begin at one place, and one follows the other."""
    walk(agent)
    contacts = [m for m in messages(heard) if isinstance(m, Contact)]
    assert contacts
    assert {contact.other_id for contact in contacts} == {"r2"}


@pytest.mark.parametrize("text", ["north", "1", "1,2,3,4", "1,nan", "1e9,2"])
def test_a_point_that_is_none_is_refused(text: str) -> None:
    command = [
        "run",
        "--insecure",
        "--id",
        "r1",
        "--source",
        "simulated:corridor",
        f"--stands-at={text}",
    ]
    with capture_logs() as logs:
        code = app(command, exit_on_error=False, result_action="return_value")
    assert code == ExitCode.USAGE
    assert logs


def test_a_ride_is_told_as_it_is_and_replays_alike(heard: list[Received]) -> None:
    """Live, and from the samples as recorded: floors by the barometer, the lift by its name."""
    ride = (Stand(8.0), Ride("third"), Move("walk", ((4.0, 0.0),)))
    scenario = msgspec.structs.replace(
        lone_walk(*ride, floor="first"), barometer=BarometerSettings(fans_per_min=0.0)
    )
    live = list(simulate_boot_imu(scenario, "r1", seed=6).samples(10**18))

    def told(samples: Iterable[ImuSample]) -> list[Message]:
        heard.clear()
        network = MemoryNetwork()
        network.connect().subscribe("clew/**", heard.append)
        sender = Sender(network.connect(), "fire", "responder", "r1")
        agent = Agent(sender, make_mount("boot", "eskf"), "eskf", None)
        for sample in samples:
            agent.take(sample)
        agent.finish()
        return list(messages(heard))

    said = told(live)
    recorded = [sample for m in said if isinstance(m, ImuBatch) for sample in samples_of(m)]
    assert recorded == live
    assert told(recorded) == said
    increments = [m for m in said if isinstance(m, OdometryIncrement)]
    lifted = [m for m in increments if m.activity == "lift"]
    assert len(lifted) >= 4
    assert all((m.d_north_m, m.d_east_m) == (0.0, 0.0) for m in lifted)
    assert -sum(m.d_down_m for m in increments) == pytest.approx(6.6, rel=0.12)


def samples_of(batch: ImuBatch) -> Iterator[ImuSample]:
    pressures_pa = dict(zip(batch.pressure_rows, batch.pressure_pa, strict=True))
    forces, rates, fields = map(threes, (batch.force_m_s2, batch.rate_rad_s, batch.field_ut))
    for row, time_ns in enumerate(batch.time_ns):
        yield ImuSample(time_ns, forces[row], rates[row], fields[row], pressures_pa.get(row))


def threes(flat: tuple[float, ...]) -> list[Vector3]:
    return list(zip(flat[0::3], flat[1::3], flat[2::3], strict=True))


def test_a_unit_that_cannot_keep_what_it_says_tells_so(heard: list[Received]) -> None:
    network = MemoryNetwork()
    network.connect().subscribe("clew/**", heard.append)
    sender = Sender(network.connect(), "fire", "responder", "r1")
    mount = make_mount("boot", "linear")
    walk(Agent(sender, mount, "linear", None, keeps=lambda: False))
    told = [message for message in messages(heard) if isinstance(message, NodeHealth)]
    assert told
    assert {message.findings[-1] for message in told} == {NOT_KEPT}
    assert "ok" not in {message.level for message in told}


def test_a_wearer_who_may_have_gone_on_is_not_put_back(heard: list[Received]) -> None:
    network = MemoryNetwork()
    network.connect().subscribe("clew/**", heard.append)
    sender = Sender(network.connect(), "fire", "responder", "r1")
    agent = Agent(sender, make_mount("boot", "linear"), "linear", HERE, stands_at=HERE)
    agent.forget_place()
    walk(agent)
    starts = [message for message in messages(heard) if isinstance(message, TrackStart)]
    assert {start.position for start in starts} == {None}
    assert not any(isinstance(message, PositionFix) for message in messages(heard))
