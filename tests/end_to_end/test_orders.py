"""What a commander says reaches a running post, and its recording."""

from __future__ import annotations

import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from structlog.testing import capture_logs

from command_post.__main__ import app
from command_post.commands import orders
from command_post.review.past import Past
from shared.codec import Refusal, decode, message_of, parse_key
from shared.geodesy import Origin
from shared.mcap_index import IndexedRecording
from shared.mcap_reader import read_recording
from shared.messages import HeightFix, Message, OrderReply, OriginSet, PositionFix
from shared.process import ExitCode
from tests.bus.test_zenoh import free_endpoint
from tests.waiting import DEADLINE_S, wait_for

FOR_TEST = ("--insecure", "--incident", "test")


def order(*arguments: str) -> int:
    code = app(list(arguments), exit_on_error=False, result_action="return_value")
    assert isinstance(code, int)
    return code


def said_by_the_commander(recording: Path) -> Iterator[tuple[str, Message]]:
    for message in read_recording(recording):
        key = parse_key(message.key)
        assert not isinstance(key, Refusal)
        if key.node_id == "commander":
            decoded = decode(key, message.payload)
            assert not isinstance(decoded, Refusal)
            yield str(key), decoded


def test_a_click_and_a_floor_are_recorded_by_the_running_post(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(orders, "FIND_POST_S", DEADLINE_S)
    monkeypatch.setattr(orders, "ANSWER_S", DEADLINE_S)
    endpoint, recording = free_endpoint(), tmp_path / "incident.mcap"
    command = [sys.executable, "-m", "command_post", "run", *FOR_TEST, "--listen", endpoint,
               "--record", str(recording)]  # fmt: skip
    to_post = (*FOR_TEST, "--connect", endpoint)
    with subprocess.Popen(command, stderr=subprocess.PIPE) as post:
        try:
            place = ("--north", "12.5", "--east=-3", "--sd", "1.5")
            assert order("click", *to_post, "--responder", "r1", *place) == ExitCode.OK
            assert order("floor", *to_post, "--dap", "dap2", "--height", "3.2") == ExitCode.OK
            assert order("floor", *to_post, "--responder", "r1", "--height", "0") == ExitCode.OK
            assert order("origin", "set", "37.5,127,38,12.5", *to_post) == ExitCode.OK
            with capture_logs() as logs:
                assert (
                    order("click", *to_post, "--responder", "r1", *place, "--id", "post")
                    == ExitCode.USAGE
                )
            assert "is the post's own" in logs[-1]["event"]
            post.send_signal(signal.SIGTERM)
            assert post.wait(DEADLINE_S) == ExitCode.OK
        finally:
            post.kill()
    (click_key, click), (_, dap), (_, floor), (_, origin) = said_by_the_commander(recording)
    assert isinstance(origin, OriginSet)
    with IndexedRecording([recording]) as indexed:
        assert Past(indexed).origin() == Origin.said(origin)
    assert click_key == "clew/v1/test/post/commander/fix"
    assert isinstance(click, PositionFix)
    assert (click.responder_id, click.source) == ("r1", "commander")
    assert (click.position.north_m, click.position.east_m) == (12.5, -3.0)
    assert click.position.covariance_m2 == (2.25, 0.0, 2.25)
    assert isinstance(dap, HeightFix)
    assert (dap.node, dap.node_id, dap.down_m, dap.sd_m) == ("dap", "dap2", -3.2, 0.5)
    assert isinstance(floor, HeightFix)
    assert (floor.node, floor.node_id) == ("responder", "r1")
    assert floor.sequence > dap.sequence


def replies_in(recording: Path) -> list[OrderReply]:
    found = []
    for each in read_recording(recording):
        message = message_of(each.key, each.payload)
        if isinstance(message, OrderReply):
            found.append(message)
    return found


def test_an_order_goes_to_the_wearer_and_the_acknowledgement_comes_back(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(orders, "FIND_POST_S", DEADLINE_S)
    monkeypatch.setattr(orders, "ANSWER_S", DEADLINE_S)
    endpoint, recording = free_endpoint(), tmp_path / "incident.mcap"
    run = (*FOR_TEST, "--listen", endpoint, "--record", str(recording))
    unfinished = recording.with_name("incident.mcap.part")
    walk = (*FOR_TEST, "--connect", endpoint, "--id", "r1", "--source", "simulated:four_daps",
            "--journal", str(tmp_path / "r1.journal"), "--no-imu")  # fmt: skip
    python = (sys.executable, "-m")
    with (
        subprocess.Popen([*python, "command_post", "run", *run], stderr=subprocess.PIPE) as post,
        subprocess.Popen(
            [*python, "edge_agent", "run", *walk], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
        ) as agent,
    ):
        try:
            to_post = (*FOR_TEST, "--connect", endpoint)
            # It is heard of once its agent has come.
            wait_for(
                lambda: (
                    order("order", "message", "--to", "r1", "--text", "out", *to_post)
                    == ExitCode.OK
                ),
                "the agent to be heard",
                2 * DEADLINE_S,
            )
            assert capsys.readouterr().out.endswith("r1\n")
            with capture_logs() as logs:
                code = order("order", "evacuate", "--to", "r7", *to_post)
            assert code == ExitCode.USAGE
            assert logs[-1]["event"] == "r7: not heard so far; r1 have been"
            assert agent.stdout is not None
            assert agent.stdout.readline() == b"ORDER MESSAGE: out\n"
            agent.send_signal(signal.SIGUSR1)
            wait_for(
                lambda: (
                    {each.stage for each in replies_in(unfinished)} == {"received", "acknowledged"}
                ),
                "the acknowledgement in the recording",
            )
            agent.send_signal(signal.SIGTERM)
            assert agent.wait(DEADLINE_S) == ExitCode.OK
            post.send_signal(signal.SIGTERM)
            assert post.wait(DEADLINE_S) == ExitCode.OK
        finally:
            agent.kill()
            post.kill()


@pytest.mark.parametrize("rest", [(), ("--to", "r1", "--all"), ("--to", "r/1")])
def test_whom_an_order_is_for_is_to_be_said(rest: tuple[str, ...]) -> None:
    with capture_logs() as logs:
        assert order("order", "roll-call", "--insecure", *rest) == ExitCode.USAGE
    assert "--to" in logs[-1]["event"]


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (
            ["click", "--insecure", "--responder", "r/1", "--north", "1", "--east", "2"],
            "--responder 'r/1'",
        ),
        (["floor", "--insecure", "--height", "3"], "either --responder or --dap"),
        (["floor", "--insecure", "--height", "3", "--dap", "d1", "--responder", "r1"], "either"),
        (
            ["floor", "--insecure", "--height", "3", "--dap", "d1", "--connect", "udp"],
            "write tcp/HOST:PORT",
        ),
    ],
)
def test_mistakes_are_told(arguments: list[str], complaint: str) -> None:
    with capture_logs() as logs:
        assert order(*arguments) == ExitCode.USAGE
    assert complaint in logs[-1]["event"]


def test_without_a_post_there_is_nobody_to_tell(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(orders, "FIND_POST_S", 0.1)
    with capture_logs() as logs:
        code = order(
            "floor", "--insecure", "--height", "3", "--dap", "d1", "--connect", free_endpoint()
        )
    assert code == ExitCode.FAILURE
    assert any("no post of incident" in entry["event"] for entry in logs)
