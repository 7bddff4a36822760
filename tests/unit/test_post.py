"""The post's shell on the memory bus: what it hears, records, and says."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from threading import Event, Thread

import pytest
from msgspec import structs

from command_post.commands.scoring import read_evidence
from command_post.desks.announcer import Outgoing
from command_post.incident import Incident, IncidentSettings
from command_post.last_messages import LastMessages
from command_post.post import Post
from command_post.recorder.parts import RecordingSet, Rotation
from command_post.recorder.recording import RecordedIncident, Recorder
from command_post.replay import replay
from command_post.resuming.checkpoint import Checkpoints
from command_post.resuming.gist import Gist
from command_post.resuming.taking_up import TakingUp
from command_post.roster import Roster
from shared.bus.interface import Bus, Received
from shared.bus.memory import MemoryNetwork
from shared.clock import ManualClock
from shared.codec import Refusal, decode, encode, parse_key
from shared.mcap_reader import read_recording
from shared.messages import (
    ExerciseStart,
    OdometryIncrement,
    Receipt,
    SafeUpTo,
    StationTable,
    TrackEstimate,
    TrackStart,
)
from shared.seal import sealed
from shared.topics import Key, alive_key
from shared.units import NS_PER_S
from tests.heard import message_in
from tests.waiting import wait_for

START_NS = 1_700_000_000 * NS_PER_S
NOW_NS = START_NS + 8 * NS_PER_S
SETTINGS = IncidentSettings(incident="fire", post_id="p")


def start(sequence: int = 0) -> bytes:
    return encode(
        TrackStart(
            event_time_ns=START_NS,
            sequence=sequence,
            position=None,
            heading_sd_rad=0.2,
            mount="boot",
            method="linear",
        )
    )


def stride(number: int) -> bytes:
    return encode(
        OdometryIncrement(
            event_time_ns=START_NS + (number + 1) * NS_PER_S,
            sequence=number,
            start_time_ns=START_NS + number * NS_PER_S,
            d_north_m=1.2,
            d_east_m=0.0,
            d_down_m=0.0,
            d_heading_rad=0.0,
            heading_rad=0.0,
            covariance=(0.01, 0.0, 0.0, 0.0, 0.01, 0.0, 0.0, 0.01, 0.0, 0.001),
            mount="boot",
        )
    )


def key(topic: str, role: str = "responder", node: str = "r1") -> str:
    return f"clew/v1/fire/{role}/{node}/{topic}"


def estimate_in(received: Received) -> TrackEstimate:
    estimate = message_in(received)
    assert isinstance(estimate, TrackEstimate)
    return estimate


@contextmanager
def serving(
    network: MemoryNetwork,
    path: Path,
    *,
    follows_exercise: bool = False,
    stations: StationTable | None = None,
    checkpoints: Callable[[Recorder], Checkpoints | None] = lambda _: None,
) -> Iterator[tuple[Bus, ManualClock, list[Roster]]]:
    """Run a post; give the bus of somebody else, the post's clock and what it shows."""
    clock, shown, stop = ManualClock(NOW_NS), list[Roster](), Event()
    with (
        network.connect() as bus,
        network.connect() as other,
        Recorder(path, {}, resume=True) as recorder,
    ):
        post = Post(
            bus, Incident(SETTINGS), recorder, clock,
            follows_exercise=follows_exercise, show=shown.append, stations=stations,
            checkpoints=checkpoints(recorder),
        )  # fmt: skip
        if recorder.unfinished is not None:
            recording, gist = read_recording(recorder.unfinished), Gist()
            gist.read(recording)
            post.take_up(TakingUp(recording, gist, (), partial(Incident, SETTINGS)))
        alive: set[str] = set()
        other.watch_alive(alive_key("fire", "post", "p"), lambda name, _: alive.add(name))
        thread = Thread(target=post.serve, args=(stop,))
        thread.start()
        try:
            wait_for(lambda: alive, "the post")
            yield other, clock, shown
        finally:
            stop.set()
            thread.join()


def recorded_keys(path: Path) -> list[str]:
    return [message.key.removeprefix("clew/v1/fire/") for message in read_recording(path)]


STATIONS = StationTable(
    event_time_ns=0, sequence=0, responders=(("02:00:5e:10:00:01", "r1"),), daps=()
)


def test_whose_radios_are_whose_is_told_to_whoever_comes_and_recorded_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("command_post.station_notice.LEAST_PAUSE_S", 0.0)
    path, network, heard = tmp_path / "a.mcap", MemoryNetwork(), list[Received]()
    with serving(network, path, stations=STATIONS) as (other, _, _):
        other.subscribe(key("stations", "post", "p"), heard.append)
        for number in range(2):
            told = len(heard)
            other.declare_alive(alive_key("fire", "dap", f"dap{number}"))
            wait_for(lambda: len(heard) > told, "the table")  # noqa: B023
    tables = [message_in(each) for each in heard]
    assert {(each.responders, each.daps) for each in tables if isinstance(each, StationTable)} == {
        (STATIONS.responders, ())
    }
    assert recorded_keys(path).count("post/p/stations") == 1
    report = replay(path, Incident(SETTINGS))
    assert report.identical


def test_strides_become_estimates_published_and_recorded_once(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    said: list[Received] = []
    with serving(MemoryNetwork(), path) as (other, _, shown):
        other.subscribe(key("track", "post", "p"), said.append)
        other.publish(key("start"), start())
        for number in range(3):
            other.publish(key("increment"), stride(number))
        wait_for(lambda: len(said) == 4, "an estimate for the start and each stride")
        wait_for(lambda: shown and shown[-1].responders, "the responder in the roster")
    assert 2.5 < estimate_in(said[-1]).north_m < 4.5
    keys = recorded_keys(path)
    assert keys.count("post/p/track") == 4
    assert keys.count("responder/r1/increment") == 3


def test_whoever_comes_is_asked_for_what_was_missed(tmp_path: Path) -> None:
    said: list[Received] = []
    with serving(MemoryNetwork(), tmp_path / "a.mcap") as (other, _, _shown):
        other.subscribe(key("track", "post", "p"), said.append)
        other.answer(key("start"), lambda _: start())
        other.declare_alive(alive_key("fire", "responder", "r1"))
        wait_for(lambda: said, "a track from the answered start")
    assert "responder/r1/start" in recorded_keys(tmp_path / "a.mcap")


def test_garbage_is_evidence_and_breaks_nothing(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    said: list[Received] = []
    with serving(MemoryNetwork(), path) as (other, _, _shown):
        other.subscribe(key("track", "post", "p"), said.append)
        other.publish(key("increment"), b"\xc1")
        other.publish("clew/v9/fire/responder/r1/increment", stride(0))
        other.publish(key("nonsense"), b"?")
        other.publish(key("increment"), stride(0)[:-3])
        other.publish(key("start"), start())
        wait_for(lambda: said, "an estimate all the same")
    kept = {(message.key, message.payload) for message in read_recording(path)}
    assert (key("increment"), b"\xc1") in kept
    assert ("clew/v9/fire/responder/r1/increment", stride(0)) in kept
    assert (key("nonsense"), b"?") in kept


def test_what_a_stranger_says_under_the_posts_own_keys_is_refused_evidence(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    said: list[Received] = []
    track = key("track", "post", "p")
    with serving(MemoryNetwork(), path) as (other, _, shown):
        other.subscribe(track, said.append)
        other.publish(key("start"), start())
        wait_for(lambda: said, "the post's own estimate")
        forged = structs.replace(estimate_in(said[0]), north_m=900.0)
        other.publish(track, encode(forged))
        other.publish(key("increment"), stride(0))
        wait_for(lambda: len(said) == 3, "the post's next estimate")
        wait_for(lambda: any("another post" in each for each in shown[-1].remarks), "a remark")
    recorded = [one for one in read_recording(path) if one.key == track]
    assert [one.payload for one in recorded if not one.outgoing] == [encode(forged)]
    assert len(recorded) == 3
    (estimates,) = read_evidence(path).tracks("live").values()
    assert estimates.position_m[:, 0].max() < 100.0


def test_a_post_that_is_to_stop_does_not_handle_all_that_it_took(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, stop, handled = tmp_path / "a.mcap", Event(), list[str]()

    class Asked(Incident):
        """Is asked to stop as it handles its first message."""

        def handle(self, key: str, payload: bytes, now_ns: int) -> list[Outgoing]:
            handled.append(key)
            stop.set()
            return super().handle(key, payload, now_ns)

    monkeypatch.setattr("command_post.post.LastMessages", partial(LastMessages, lasts_s=0.0))
    network = MemoryNetwork()
    with network.connect() as bus, network.connect() as other, Recorder(path, {}) as recorder:
        post = Post(
            bus, Asked(SETTINGS), recorder, ManualClock(NOW_NS),
            follows_exercise=False, show=lambda _: None,
        )  # fmt: skip
        thread = Thread(target=post.serve, args=(stop,))
        thread.start()

        def say() -> bool:
            other.publish(key("increment"), stride(0))
            return bool(handled)

        wait_for(say, "the first message")
        thread.join()
    assert len(handled) == 1
    assert recorded_keys(path).count("responder/r1/increment") == 1


@pytest.mark.parametrize("follows", [False, True])
def test_only_an_exercise_sets_the_clock(tmp_path: Path, follows: bool) -> None:
    begun = ExerciseStart(
        event_time_ns=NOW_NS - 10 * NS_PER_S, sequence=0, scenario="any", seed=1, speed=2.0
    )
    path = tmp_path / "a.mcap"
    with serving(MemoryNetwork(), path, follows_exercise=follows) as (other, clock, shown):
        other.publish(str(Key("fire", "post", "launcher", "exercise")), encode(begun))
        other.publish(key("increment"), b"?")
        wait_for(lambda: shown and shown[-1].responders == (), "the roster")
        of_exercise = {True: lambda: shown[-1].now_ns > clock.now_ns(), False: lambda: True}
        wait_for(of_exercise[follows], "the exercise's time in the roster")
    times = {message.log_time_ns for message in read_recording(path)}
    assert (times == {clock.now_ns()}) is not follows


def test_what_is_on_the_disk_is_receipted_and_what_is_lost_comes_again(tmp_path: Path) -> None:
    run = b"\x05" * 8
    receipts: list[Receipt] = []

    def note(received: Received) -> None:
        parsed = parse_key(received.key)
        assert not isinstance(parsed, Refusal)
        receipt = decode(parsed, received.payload)
        assert isinstance(receipt, Receipt)
        receipts.append(receipt)

    with serving(MemoryNetwork(), tmp_path / "a.mcap") as (other, _, _shown):
        other.subscribe(key("receipt", "post", "p"), note)
        for number in range(3):
            other.publish(key("increment"), sealed(stride(number), run, number + 1))
        wait_for(lambda: receipts, "a receipt")
    assert receipts[0].safe == (SafeUpTo(role="responder", node_id="r1", run=run.hex(), number=3),)
    assert not any("receipt" in name for name in recorded_keys(tmp_path / "a.mcap"))


class WatchedWork(Checkpoints):
    """Notes how often work was done."""

    times = 0

    def work(self, seconds: float) -> None:
        """Note that handling has taken so long."""
        super().work(seconds)
        self.times += 1


def test_what_becomes_due_while_nothing_is_heard_is_work_too(tmp_path: Path) -> None:
    watched: list[WatchedWork] = []

    def checkpoints(recorder: Recorder) -> Checkpoints:
        watched.append(WatchedWork(tmp_path / "state", recorder))
        return watched[0]

    said: list[Received] = []
    path = tmp_path / "a.mcap"
    with serving(MemoryNetwork(), path, checkpoints=checkpoints) as (other, clock, shown):
        other.subscribe(key("track", "post", "p"), said.append)
        other.publish(key("start"), start())
        # Still to come by the post's clock: it is held until then.
        other.publish(key("increment"), stride(8))
        wait_for(lambda: shown and shown[-1].responders, "the responder in the roster")
        wait_for(lambda: watched[0].times == 2, "both to be handled")
        before = len(said)
        clock.set_ns(NOW_NS + 5 * NS_PER_S)
        wait_for(lambda: len(said) > before, "the estimate of the stride")
    assert watched[0].times > 2


@pytest.mark.parametrize("rotation", [None, Rotation(1, 1)], ids=["one file", "parts"])
def test_a_post_that_was_killed_goes_on_where_it_was(
    tmp_path: Path, rotation: Rotation | None
) -> None:
    path, network, run = tmp_path / "a.mcap", MemoryNetwork(), b"\x05" * 8
    file = RecordingSet(path, {}, rotation=rotation)
    incident = RecordedIncident(Incident(SETTINGS), file)
    incident.handle(key("start"), start(), NOW_NS)
    for number in range(3):
        incident.handle(key("increment"), sealed(stride(number), run, number + 1), NOW_NS)
        file.sync()
        file.rotate_if_due()
    file.abandon()
    said: list[Received] = []
    with serving(network, path) as (other, clock, shown):
        other.subscribe(key("track", "post", "p"), said.append)
        # By now nobody waits any more for the unit to say how far its clock is off.
        clock.set_ns(NOW_NS + 60 * NS_PER_S)
        # One that came before, and one that is new.
        other.publish(key("increment"), sealed(stride(2), run, 3))
        other.publish(key("increment"), sealed(stride(3), run, 4))
        wait_for(lambda: said and estimate_in(said[-1]).north_m > 4.0, "the new stride's estimate")
        wait_for(lambda: shown and shown[-1].responders, "the responder in the roster")
    # One for each stride, and of the silence between, each once.
    assert [estimate_in(each).sequence for each in said] == list(range(1, len(said) + 1))
    assert recorded_keys(path).count("responder/r1/increment") == 4
    report = replay(path, Incident(SETTINGS))
    assert report.identical, report
    assert report.reading.resumed_count == 1
