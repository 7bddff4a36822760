"""Refused links, and what access rules turn away, are counted, told and alerted to."""

from __future__ import annotations

import os
import signal
import socket
import ssl
import subprocess
import sys
from collections.abc import Iterator
from contextlib import suppress
from datetime import timedelta
from functools import partial
from pathlib import Path

import pytest
from structlog.testing import capture_logs

from shared.bus.refused_links import RefusedLinks
from shared.bus.zenoh_bus import open_zenoh
from shared.codec import message_of
from shared.mcap_reader import read_recording
from shared.messages import Alert
from shared.process import ExitCode
from tests.bus.test_zenoh import free_endpoint, port_of
from tests.issued_keys import Keys, now
from tests.waiting import DEADLINE_S, wait_for


def is_told(log: Path, reason: str) -> bool:
    return f"reason={reason}" in log.read_text()


@pytest.mark.skipif(os.name != "posix", reason="Windows has no such pipes")
def test_a_dap_tells_of_all_that_it_refused(tmp_path: Path) -> None:
    keys = Keys(tmp_path / "keys", ["dap1", "r1"])
    endpoint, log, out = free_endpoint().replace("tcp", "tls"), tmp_path / "log", tmp_path / "out"
    command = [sys.executable, "-m", "dap_node", "run", "--id", "dap1", "--await-start",
               "--keys", str(keys["dap1"].folder), "--source", "simulated:four_daps",
               "--journal", str(tmp_path / "dap1.journal"),
               "--listen", endpoint, "--connect", "tls/127.0.0.1:9"]  # fmt: skip
    with (
        log.open("wb") as logged,
        out.open("wb") as said,
        subprocess.Popen(command, stderr=logged, stdout=said) as dap,
    ):
        try:
            wait_for(lambda: "session open" in log.read_text(), "the DAP")
            keys.issue("late")
            expired = keys.date("r1", end=now() - timedelta(days=1))
            foreign = Keys(tmp_path / "others", ["r1"])["r1"]
            port = port_of(endpoint)
            with socket.create_connection(("127.0.0.1", port)) as plain:
                plain.sendall(b"GET / HTTP/1.0\r\n\r\n")
            trusting = ssl.create_default_context(cafile=str(keys["dap1"].folder / "authority.pem"))
            with (
                suppress(ssl.SSLError),
                socket.create_connection(("127.0.0.1", port)) as plain,
                trusting.wrap_socket(plain, server_hostname="localhost") as nameless,
            ):
                nameless.recv(1)
            for bundle, reason in (
                (expired, "expired"), (keys["late"], "not_named"),
                (foreign, "does_not_accept_ours"),
            ):  # fmt: skip
                with open_zenoh("client", [endpoint], bundle=bundle):
                    wait_for(partial(is_told, log, reason), reason)
            dap.send_signal(signal.SIGTERM)
            assert dap.wait(DEADLINE_S) == ExitCode.OK
        finally:
            dap.kill()
    ended = [line for line in log.read_text().splitlines() if "links refused in all" in line]
    for reason in ("not_tls", "no_certificate", "expired", "not_named", "does_not_accept_ours"):
        assert any(f"reason={reason}" in line for line in ended), (reason, ended)
    assert out.read_bytes() == b""


def test_it_is_told_at_powers_of_ten_and_not_each_time() -> None:
    links = RefusedLinks()
    with capture_logs() as logs:
        for _ in range(150):
            links.note("WARN invalid peer certificate: UnknownIssuer. Hint: ...")
        links.note("something else")
    assert [(each["reason"], each["count"]) for each in logs] == [
        ("foreign", 1), ("foreign", 10), ("foreign", 100),
    ]  # fmt: skip
    assert links.counts == {"foreign": 150}


def test_what_is_not_ones_own_to_say_is_counted_by_who_says_it_and_whom_it_names() -> None:
    links = RefusedLinks()
    with capture_logs() as logs:
        for _ in range(12):
            links.note(turned_away("responder/r2/increment"))
        links.note(turned_away("responder/r2/alarm"))
        links.note(turned_away("post"))
    assert links.breaches == {("", "r2"): 13, ("", ""): 1}
    assert links.counts == {}
    assert [each["count"] for each in logs] == [1, 10, 1]


def test_who_invents_names_is_counted_all_the_same() -> None:
    links = RefusedLinks()
    for number in range(2000):
        links.note(turned_away(f"responder/r{number}/increment"))
    assert links.breaches.total() == 2000
    assert len(links.breaches) <= 1001


def turned_away(key: str) -> str:
    words = f"96a is unauthorized to Put (ingress) on clew/v1/fire/{key}"
    return f"TRACE ThreadId(01) log: Using cached result: {words}"


@pytest.mark.skipif(os.name != "posix", reason="Windows has no such pipes")
def test_a_post_is_alerted_to_strangers_and_to_who_speaks_for_others(tmp_path: Path) -> None:
    keys = Keys(tmp_path / "keys", ["post", "dap1", "r1", "r2"])
    endpoint, log = free_endpoint().replace("tcp", "tls"), tmp_path / "log"
    command = [sys.executable, "-m", "command_post", "run", "--incident", "fire",
               "--keys", str(keys["post"].folder), "--record", str(tmp_path / "fire.mcap"),
               "--listen", endpoint]  # fmt: skip
    with log.open("wb") as logged, subprocess.Popen(command, stderr=logged) as post:
        try:
            with (
                open_zenoh("client", [endpoint], bundle=keys["r1"]) as client,
                open_zenoh("router", [endpoint], ["tls/127.0.0.1:0"], keys["dap1"]) as dap,
            ):
                wait_for(client.connected, "the post", 2 * DEADLINE_S)
                wait_for(dap.connected, "the post", 2 * DEADLINE_S)
                with socket.create_connection(("127.0.0.1", port_of(endpoint))) as plain:
                    plain.sendall(b"GET / HTTP/1.0\r\n\r\n")

                client.subscribe("clew/**", lambda _: None)
                client.query("clew/v1/fire/responder/r2/journal", timeout_s=DEADLINE_S)

                def speak() -> bool:
                    client.publish("clew/v1/fire/responder/r2/increment", b"not mine")
                    dap.publish("clew/v1/fire/responder/r2/increment", b"handed on")
                    dap.publish("clew/v1/fire/post/post/order", b"not mine")
                    return len(list(alerts_in(tmp_path / "fire.mcap.part"))) == 4

                wait_for(speak, "the alerts")
            post.send_signal(signal.SIGTERM)
            assert post.wait(DEADLINE_S) == ExitCode.OK
        finally:
            post.kill()
    for would in ("listen", "ask"):
        assert f"node_id=r1 would={would}" in log.read_text()
    alerts = {alert.node_id: alert for alert in alerts_in(tmp_path / "fire.mcap")}
    assert {alert.kind for alert in alerts.values()} == {"intruder"}
    assert alerts["r1"].words == "says what is r2's to say, and is not let"
    assert alerts["dap1"].words == "says what is post's to say, and is not let"
    # What it hands on is let pass, and found not to be signed.
    assert "signature" in alerts["r2"].words
    assert "does not encrypt" in alerts["link-not_tls"].words
    assert set(alerts) == {"r1", "r2", "dap1", "link-not_tls"}


def is_begun(recording: Path) -> bool:
    return recording.exists() and recording.stat().st_size > 1000


def alerts_in(recording: Path) -> Iterator[Alert]:
    # It has its name before it has anything in it.
    for each in read_recording(recording) if is_begun(recording) else ():
        message = message_of(each.key, each.payload)
        if isinstance(message, Alert):
            yield message
