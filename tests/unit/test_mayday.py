"""A wearer's call for help: what a button means, what is said until it is heard, who is told."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import pytest

from command_post.incident import Incident, IncidentSettings
from edge_agent.__main__ import app
from edge_agent.mayday import (
    CALLS_S,
    CANCELS_S,
    HEARD_PERIOD_S,
    UNHEARD_PERIOD_S,
    HeldButton,
    MaydayCall,
)
from edge_agent.mayday_controls import (
    EV_KEY,
    INPUT_EVENT,
    InputButton,
    Request,
    UnitSocket,
    socket_path,
)
from edge_agent.mayday_desk import MaydayDesk
from shared.bus.memory import MemoryNetwork
from shared.clock import ManualClock
from shared.codec import decode, encode, parse_key
from shared.gate import Gate
from shared.messages import Alert, AlertRequest, Mayday, MaydayAnswer, Message
from shared.process import ExitCode
from shared.sender import Sender
from shared.topics import Key
from tests.waiting import wait_for


def test_a_button_is_to_be_held_and_each_press_means_one_thing() -> None:
    button = HeldButton()
    button.press(0.0)
    assert button.act(CALLS_S - 0.1, stands=False) is None
    button.release()
    assert button.act(5.0, stands=False) is None
    button.press(10.0)
    button.press(10.5)  # a key that repeats
    assert button.act(10.0 + CALLS_S, stands=False) == "call"
    assert button.act(10.0 + CANCELS_S, stands=True) is None
    button.release()
    button.press(20.0)
    assert button.act(20.0 + CALLS_S, stands=True) is None
    assert button.act(20.0 + CANCELS_S, stands=True) == "cancel"


def answer(
    called_ns: int, stage: str = "heard", phase: str = "called", by: str | None = None
) -> MaydayAnswer:
    return MaydayAnswer(
        event_time_ns=0, sequence=0, responder_id="r1", called_ns=called_ns, phase=phase,  # type: ignore[arg-type]
        stage=stage, by=by,  # type: ignore[arg-type]
    )  # fmt: skip


def test_a_call_is_said_until_it_is_heard_and_then_now_and_again() -> None:
    call = MaydayCall("r1", "post")
    assert call.take("cancel", "by hand", 5) == "NOT CALLED"
    assert call.take("call", "by hand", 7) == "CALLED"
    said = call.due(0.0, linked=False)
    assert said == ("called", 7, 7, "by hand"), "it goes into the journal at once"
    assert call.due(UNHEARD_PERIOD_S, linked=False) is None
    assert call.due(UNHEARD_PERIOD_S, linked=True) == said
    assert call.hear("another", answer(7), 8) is None
    assert call.hear("post", answer(6), 8) is None, "of an earlier call"
    assert call.hear("post", answer(7), 8) == "HEARD"
    assert call.hear("post", answer(7), 8) is None
    assert call.due(2 * UNHEARD_PERIOD_S, linked=True) is None
    assert call.due(UNHEARD_PERIOD_S + HEARD_PERIOD_S, linked=True) == said
    assert call.hear("post", answer(7, "acknowledged", by="kim"), 9) == "ACKNOWLEDGED BY kim"
    assert call.take("cancel", "by hand", 20) == "CANCELLED"
    assert call.due(30.0, linked=True) == ("cancelled", 7, 20, "by hand")
    assert call.hear("post", answer(7), 21) is None, "an answer to the call is none to its end"
    assert call.hear("post", answer(7, phase="cancelled"), 21) == "END HEARD"
    assert call.due(99.0, linked=True) is None


def test_who_is_still_in_need_after_the_post_resolved_it_calls_anew() -> None:
    call = MaydayCall("r1", "post")
    call.take("call", "by hand", 7)
    call.due(0.0, linked=True)
    assert call.hear("post", answer(7, "resolved", by="kim"), 9) == "RESOLVED BY kim"
    over = call.due(1.0, linked=True)
    assert over is not None
    assert over[:3] == ("cancelled", 7, 9)
    assert call.take("call", "by hand", 30) == "CALLED"
    assert call.due(2.0, linked=True) == ("called", 30, 30, "by hand")


def test_a_call_that_a_kill_broke_off_goes_on() -> None:
    call = MaydayCall("r1", "post")
    call.go_on(Mayday(event_time_ns=7, sequence=0, phase="called", called_ns=7, reason="by hand"))
    assert call.stands
    assert call.due(0.0, linked=True) == ("called", 7, 7, "by hand")


@pytest.fixture
def device(tmp_path: Path) -> Iterator[tuple[Path, int]]:
    """Something that is read as an input device is."""
    path = tmp_path / "event0"
    os.mkfifo(path)
    writer = os.open(path, os.O_RDWR | os.O_NONBLOCK)
    yield path, writer
    os.close(writer)


def test_any_key_of_an_input_device_is_the_button(
    device: tuple[Path, int], monkeypatch: pytest.MonkeyPatch
) -> None:
    now_s = [0.0]
    monkeypatch.setattr("edge_agent.mayday_controls.time.monotonic", lambda: now_s[0])
    path, writer = device
    button = InputButton(path)
    assert button.requests(stands=False) == []
    os.write(writer, INPUT_EVENT.pack(0, 0, 4, 4, 30) + INPUT_EVENT.pack(0, 0, EV_KEY, 115, 1))
    assert button.requests(stands=False) == []
    now_s[0] = CALLS_S
    assert button.requests(stands=False) == [Request("call", "the button was held")]
    os.write(writer, INPUT_EVENT.pack(0, 0, EV_KEY, 115, 0))
    now_s[0] = 10.0
    assert button.requests(stands=True) == []
    button.close()


def test_a_button_that_is_not_there_yet_is_looked_for_again(tmp_path: Path) -> None:
    button = InputButton(tmp_path / "event9")
    assert button.requests(stands=False) == []
    button.close()


def decoded(key_text: str, payload: bytes) -> Message:
    key = parse_key(key_text)
    assert isinstance(key, Key)
    message = decode(key, payload)
    assert isinstance(message, Message), message
    return message


class World:
    """A unit whose wearer calls by the command, and a post that answers, on one network."""

    def __init__(self, journal: Path) -> None:
        network = MemoryNetwork()
        self.incident = Incident(IncidentSettings(incident="fire"))
        self.alerts: list[Alert] = []
        self.post = network.connect()
        self.post.subscribe("clew/v1/fire/responder/**", lambda got: self.handle(*got))
        bus = network.connect()
        self.desk = MaydayDesk(
            bus, "fire", MaydayCall("r1", "post"), Sender(bus, "fire", "responder", "r1"), Gate(),
            ManualClock(10**18), [UnitSocket(socket_path(journal))],
        )  # fmt: skip

    def handle(self, key: str, payload: bytes) -> None:
        """Let the post take a message in, and publish what comes of it."""
        for outgoing in self.incident.handle(key, payload, 10**18):
            message = decoded(*outgoing)
            if isinstance(message, Alert):
                self.alerts.append(message)
            self.post.publish(*outgoing, "high")

    def request(self, stage: str) -> None:
        """Let kim do something about the newest alert."""
        asked = AlertRequest(
            event_time_ns=0, sequence=0, number=self.alerts[-1].number, stage=stage,  # type: ignore[arg-type]
            assigned_to=None,
        )  # fmt: skip
        self.handle("clew/v1/fire/post/kim/alert_request", encode(asked))


def mayday(journal: Path, *more: str) -> int:
    code = app(
        ["mayday", "--id", "r1", "--journal", str(journal), *more],
        exit_on_error=False, result_action="return_value",
    )  # fmt: skip
    assert isinstance(code, int)
    return code


def test_a_call_by_the_command_is_heard_acknowledged_and_taken_back(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    journal = tmp_path / "j"
    world = World(journal)
    with world.desk:
        assert mayday(journal, "--wait", "30") == ExitCode.OK
        assert world.alerts[-1].words == "calls mayday: said at the unit"
        (row,) = world.incident.alarms["r1"].values()
        assert (row.alarm.kind, row.alarm.phase) == ("mayday", "alarm")
        world.request("acknowledged")
        wait_for(lambda: "ACKNOWLEDGED BY kim" in capsys.readouterr().out, "the wearer to be told")
        assert mayday(journal, "--cancel", "--wait", "30") == ExitCode.OK
        assert (world.alerts[-1].stage, world.alerts[-1].by) == ("resolved", None)
        assert mayday(journal, "--wait", "30") == ExitCode.OK
        assert world.alerts[-1].stage == "raised"
        assert len({alert.number for alert in world.alerts}) == 2
    assert not socket_path(journal).exists()


def test_without_an_agent_the_command_says_so(tmp_path: Path) -> None:
    assert mayday(tmp_path / "j") == ExitCode.FAILURE


def test_what_comes_late_out_of_the_journal_raises_nothing_again() -> None:
    incident = Incident(IncidentSettings(incident="fire"))

    def hear(phase: str, event_ns: int, sequence: int) -> list[Message]:
        said = Mayday(
            event_time_ns=event_ns, sequence=sequence, phase=phase, called_ns=10, reason="by hand"  # type: ignore[arg-type]
        )  # fmt: skip
        made = incident.handle("clew/v1/fire/responder/r1/mayday", encode(said), 100)
        return [decoded(*each) for each in made]

    alert, heard = hear("called", 10, 0)
    assert isinstance(alert, Alert)
    assert isinstance(heard, MaydayAnswer)
    assert (heard.stage, heard.phase) == ("heard", "called")
    over, _ = hear("cancelled", 20, 1)
    assert isinstance(over, Alert)
    assert over.stage == "resolved"
    (again,) = hear("called", 10, 0)
    assert isinstance(again, MaydayAnswer)
    assert incident.alarms["r1"]["mayday"].alarm.phase == "cancelled"
