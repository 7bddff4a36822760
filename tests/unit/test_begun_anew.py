"""A killed post without a state that fits goes on from what it had told last of everybody."""

from __future__ import annotations

import math
import pickle
from collections.abc import Iterable
from functools import partial
from pathlib import Path
from threading import Event, Thread

import pytest

from command_post.incident import Incident, IncidentSettings
from command_post.post import Post
from command_post.recorder.parts import RecordingSet
from command_post.recorder.recorded import Outgoing
from command_post.recorder.recording import RecordedIncident, Recorder
from command_post.resuming.gist import Gist
from command_post.resuming.last_told import LastTold
from command_post.resuming.taking_up import TakingUp
from command_post.roster import Roster
from shared.bus.interface import Received
from shared.bus.memory import MemoryNetwork
from shared.clock import ManualClock
from shared.codec import encode
from shared.mcap_reader import read_recording
from shared.messages import (
    Alert,
    AlertRequest,
    DapEstimate,
    Mayday,
    Message,
    Order,
    OrderReply,
    OrderRequest,
    TrackEstimate,
)
from shared.topics import Key
from shared.units import NS_PER_S
from tests.benchmarks.crowd import START_NS, Said, crowd
from tests.benchmarks.test_team_speed import role_of, topic_of
from tests.heard import message_in
from tests.waiting import wait_for

SETTINGS = IncidentSettings(incident="fire")
KILLED_NS = START_NS + 75 * NS_PER_S
ON_THE_WAY_NS = NS_PER_S // 50


def key_of(said: Said) -> str:
    message = said.message
    if isinstance(message, (OrderRequest, AlertRequest)):
        return str(Key("fire", "post", said.node_id, topic_of(message)))
    return str(Key("fire", role_of(message), said.node_id, topic_of(message)))


def hand(incident: Incident | RecordedIncident, said: Iterable[Said]) -> list[Outgoing]:
    made: list[Outgoing] = []
    for each in said:
        now_ns = each.message.event_time_ns + ON_THE_WAY_NS
        made += incident.handle(key_of(each), encode(each.message), now_ns)
    return made


def beside() -> list[Said]:
    """Return what people want and call while everybody walks, of which some stands at the end."""
    said: list[tuple[str, Message]] = [
        ("c", OrderRequest(event_time_ns=at(20), sequence=0, kind="evacuate", to=(), text="")),
        ("c", OrderRequest(
            event_time_ns=at(21), sequence=1, kind="message", to=("r0-1",), text="back",
        )),
        ("r0-1", Mayday(
            event_time_ns=at(30), sequence=0, phase="called", called_ns=at(30), reason="by hand",
        )),
        ("c", AlertRequest(
            event_time_ns=at(33), sequence=0, number=0, stage="acknowledged", assigned_to=None,
        )),
        ("r0-0", OrderReply(
            event_time_ns=at(40), sequence=0, post_id="post", order_sequence=at(20) // 10**6 + 20,
            stage="acknowledged",
        )),
    ]  # fmt: skip
    return [Said(*each) for each in said]


def at(seconds: float) -> int:
    return START_NS + round(seconds * NS_PER_S)


@pytest.fixture(scope="module")
def walked() -> list[Said]:
    said = [*crowd([3], 0, 2.0, 1.0, seed=4), *beside()]
    return sorted(said, key=lambda each: each.message.event_time_ns)


@pytest.fixture(scope="module")
def whole(walked: list[Said], tmp_path_factory: pytest.TempPathFactory) -> tuple[Incident, Path]:
    """Return an incident at the moment when its post was killed, and its recording."""
    path = tmp_path_factory.mktemp("whole") / "a.mcap"
    file, incident = RecordingSet(path, SETTINGS.as_metadata()), Incident(SETTINGS)
    hand(RecordedIncident(incident, file), until_killed(walked))
    file.sync()
    file.abandon()
    return incident, path


def until_killed(walked: list[Said]) -> list[Said]:
    return [each for each in walked if each.message.event_time_ns <= KILLED_NS]


def begun_anew(path: Path) -> tuple[Incident, LastTold]:
    recorded = read_recording(path.with_name("a.mcap.part"))
    gist, incident = Gist(), Incident(SETTINGS)
    gist.read(recorded)
    last = gist.last_told()
    for each in last.to_handle:
        incident.recall(each.key, each.payload, each.log_time_ns)
    incident.begin_from(last)
    return incident, last


def test_everybody_is_where_they_were_told_to_be_and_what_stands_still_stands(
    whole: tuple[Incident, Path],
) -> None:
    before, path = whole
    after, last = begun_anew(path)
    assert set(after.estimates) == {"r0-0", "r0-1", "r0-2"}
    for name, told in before.estimates.items():
        now = after.estimates[name]
        # A tick solves the others as well, and tells it with what they say next.
        assert math.dist((told.north_m, told.east_m), (now.north_m, now.east_m)) < 0.2
        assert now.covariance_m2 == pytest.approx(told.covariance_m2, rel=0.3, abs=0.3)
        assert now.heading_rad == pytest.approx(told.heading_rad, abs=0.02)
    assert {name: dap.position for name, dap in after.daps.items()} == {
        name: dap.position for name, dap in last_places(last).items()
    }
    assert after.standing == before.standing
    assert dict(after.alerts) == dict(before.alerts)
    assert any(alert.stage == "acknowledged" for alert in after.alerts.values())
    for name in after.estimates:
        assert after.orders.of(name) == before.orders.of(name)
    assert after.heard_ns == before.heard_ns
    assert after.alarms == before.alarms


def last_places(last: LastTold) -> dict[str, DapEstimate]:
    return {name: place for name, (_, _, place) in last.dap_places.items()}


def test_from_then_on_it_tells_about_the_same(
    whole: tuple[Incident, Path], walked: list[Said]
) -> None:
    after, last = begun_anew(whole[1])
    rest = [each for each in walked if each.message.event_time_ns > KILLED_NS]
    known = pickle.loads(pickle.dumps(whole[0]))  # noqa: S301
    told = [message_in(Received(each.key, each.payload)) for each in hand(after, rest)]
    hand(known, rest)
    tracks = [each for each in told if isinstance(each, TrackEstimate)]
    assert [each.sequence for each in tracks] == list(
        range(last.next_sequences["track"], last.next_sequences["track"] + len(tracks))
    )
    for name, of_all in known.estimates.items():
        of_last = after.estimates[name]
        apart_m = math.dist((of_all.north_m, of_all.east_m), (of_last.north_m, of_last.east_m))
        sd_m = math.sqrt(of_last.covariance_m2[0] + of_last.covariance_m2[2])
        assert apart_m < max(3.0 * sd_m, 1.0)
        assert of_last.time_ns == of_all.time_ns
        assert of_last.status != "lost"


def test_what_had_happened_before_and_comes_now_is_recorded_and_no_more(
    whole: tuple[Incident, Path], walked: list[Said]
) -> None:
    after, _ = begun_anew(whole[1])
    again = [each for each in until_killed(walked) if topic_of(each.message) == "increment"][-30:]
    estimates = dict(after.estimates)
    hand(after, again[:20])
    assert after.counts["too_late"] + after.counts["repeated"] == 20
    assert dict(after.estimates) == estimates


def test_a_post_without_a_state_says_from_what_it_goes_on(
    whole: tuple[Incident, Path], walked: list[Said], tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    monkeypatch.setattr("command_post.resuming.taking_up.SOON_HANDLED", 150)
    path, network, stop = tmp_path / "a.mcap", MemoryNetwork(), Event()
    path.with_name("a.mcap.part").write_bytes(whole[1].with_name("a.mcap.part").read_bytes())
    shown, said = list[Roster](), list[Received]()
    with network.connect() as bus, network.connect() as other:
        with Recorder(path, SETTINGS.as_metadata(), resume=True) as recorder:
            post = Post(
                bus, Incident(SETTINGS), recorder, ManualClock(KILLED_NS + NS_PER_S),
                follows_exercise=False, show=shown.append,
            )  # fmt: skip
            assert recorder.unfinished is not None
            recording, gist = read_recording(recorder.unfinished), Gist()
            gist.read(recording)
            post.take_up(TakingUp(recording, gist, (), partial(Incident, SETTINGS)))
            other.subscribe(str(Key("fire", "post", "post", "track")), said.append)
            thread = Thread(target=post.serve, args=(stop,))
            thread.start()
            try:
                wait_for(lambda: shown, "the roster")
                for each in walked:
                    if 0 < each.message.event_time_ns - KILLED_NS < 5 * NS_PER_S:
                        other.publish(key_of(each), encode(each.message))
                wait_for(lambda: len(said) > 3, "estimates of what was made since")
            finally:
                stop.set()
                thread.join()
        assert recorder.close().fault is None
    assert any("goes on from what it had told" in remark for remark in shown[-1].remarks)
    report = read_recording(path)
    assert sum(each.key.endswith("/track") for each in report) > 150
    assert (report.report.resumed_count, report.report.begun_anew_count) == (1, 1)
    assert "by no replay" in str(report.report)


def test_alerts_are_gone_on_with_by_what_they_are_about(whole: tuple[Incident, Path]) -> None:
    after, _ = begun_anew(whole[1])
    over = Mayday(
        event_time_ns=KILLED_NS + NS_PER_S, sequence=1, phase="cancelled", called_ns=at(30),
        reason="is well",
    )  # fmt: skip
    made = [
        message_in(Received(each.key, each.payload)) for each in hand(after, [Said("r0-1", over)])
    ]
    (alert,) = (each for each in made if isinstance(each, Alert))
    assert (alert.number, alert.stage) == (0, "resolved")
    assert not any(isinstance(each, Order) for each in made)
