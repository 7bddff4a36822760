"""A DAP that was taken over passes on what it likes: nothing of what it made up is believed."""

from __future__ import annotations

import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from command_post.__main__ import app
from command_post.fusion.methods import prepare_fusion
from command_post.fusion.settings import FusionSettings
from shared.bus.interface import Received
from shared.bus.zenoh_bus import open_zenoh
from shared.codec import encode
from shared.introductions import Introductions
from shared.mcap_reader import read_recording
from shared.process import ExitCode
from shared.sender import Sender, Sign, Unkept
from shared.topics import TOPICS, everything_of
from tests.bus.test_zenoh import free_endpoint
from tests.issued_keys import Keys
from tests.traffic import increment
from tests.waiting import DEADLINE_S, wait_for

KEY = "clew/v1/fire/responder/r1/increment"
TRUE = 5


@pytest.fixture(scope="module", autouse=True)
def _prepared() -> None:
    prepare_fusion(FusionSettings())


@contextmanager
def running_post(keys: Keys, folder: Path, endpoint: str) -> Iterator[subprocess.Popen[bytes]]:
    command = [sys.executable, "-m", "command_post", "run", "--incident", "fire",
               "--keys", str(keys["post"].folder), "--listen", endpoint,
               "--record", str(folder / "fire.mcap")]  # fmt: skip
    with (folder / "log").open("wb") as log, subprocess.Popen(command, stderr=log) as post:
        try:
            yield post
        finally:
            post.kill()


def forged(sign: Sign | None, number: int) -> bytes:
    """Return a stride of r1's that somebody else made up."""
    outbox = Unkept(sign)
    return outbox.seal(TOPICS["increment"], KEY, encode(increment(number)))


def lines_of(log: Path, *words: str) -> list[str]:
    return [line for line in log.read_text().splitlines() if all(word in line for word in words)]


def test_only_what_its_own_node_signed_is_believed(tmp_path: Path) -> None:
    keys, endpoint = Keys(tmp_path / "keys"), free_endpoint().replace("tcp", "tls")
    dap = keys["dap1"]
    log = tmp_path / "log"
    with (
        running_post(keys, tmp_path, endpoint) as post,
        open_zenoh("router", [endpoint], ["tls/127.0.0.1:0"], dap) as rogue,
        open_zenoh("client", rogue.locators(), bundle=keys["r1"]) as agent,
        Introductions(agent, "fire", keys["r1"]) as introductions,
    ):
        heard: list[Received] = []
        rogue.subscribe(everything_of("fire"), heard.append)
        wait_for(introductions.introduce, "the post to know r1", DEADLINE_S)
        sender = Sender(agent, "fire", "responder", "r1", Unkept(keys["r1"].sign))
        true = [sender.send(increment(number)) for number in range(TRUE)]
        wait_for(lambda: {each.payload for each in heard} >= set(true), "the DAP to pass r1 on")
        altered = true[0].replace(b"\xa8sequence\x00", b"\xa8sequence\x07")
        assert altered != true[0]
        for payload in (forged(dap.sign, 10), forged(None, 11), encode(increment(12)), altered):
            rogue.publish(KEY, payload, "high")
        for payload in true:
            rogue.publish(KEY, payload, "high")
        rogue.publish(KEY.replace("/r1/", "/r9/"), forged(dap.sign, 13), "high")
        wait_for(lambda: lines_of(log, "turned away: unknown_signer"), "the last of them")
        command = ["click", "--incident", "fire", "--keys", str(keys["commander"].folder),
                   "--connect", endpoint, "--responder", "r1",
                   "--north", "3", "--east", "4"]  # fmt: skip
        assert app(command, result_action="return_value") == ExitCode.OK
        post.send_signal(signal.SIGTERM)
        assert post.wait(DEADLINE_S) == ExitCode.OK
    recorded = list(read_recording(tmp_path / "fire.mcap"))
    assert [each.payload for each in recorded if each.key == KEY] == true
    assert [each.key for each in recorded if "commander" in each.key] == [
        "clew/v1/fire/post/commander/fix"
    ]
    assert not any("/r9/" in each.key for each in recorded)
    for reason, count in (("forged", 2), ("unsigned", 1), ("unsealed", 1)):
        assert len(lines_of(log, f"turned away: {reason}")) == 1
        assert lines_of(log, "refused in all", f"reason={reason}", f"count={count}")
    assert "PRIVATE" not in log.read_text()
