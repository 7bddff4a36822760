"""The doctor: each ill is named, and what to do about it."""

from __future__ import annotations

import json
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import timedelta
from pathlib import Path

import pytest

from command_post.__main__ import app
from command_post.doctor.disk import check_recording
from command_post.doctor.finding import Finding
from command_post.doctor.keys import names_host, read_bundle, validity
from command_post.doctor.machine import check_clock, check_packages, check_post_clock
from command_post.doctor.network import can_dial, can_listen
from shared.bus.zenoh_bus import open_zenoh
from shared.clock import ManualClock, PacedClock, SystemClock
from shared.process import ExitCode
from shared.security.bundle import Bundle
from shared.time_service import time_answerer
from shared.topics import time_key
from shared.units import NS_PER_S
from tests.bus.test_zenoh import free_endpoint
from tests.issued_keys import Keys, now

ELSEWHERE = "tcp/127.0.0.1"


@pytest.fixture
def issued(tmp_path: Path) -> Keys:
    return Keys(tmp_path / "keys")


@contextmanager
def secured(bundle: Bundle) -> Iterator[str]:
    """Have a router listen with the keys of ``bundle``; give where."""
    with open_zenoh("router", listen=["tls/127.0.0.1:0"], bundle=bundle) as bus:
        (locator,) = bus.locators()
        yield locator


def is_fault(found: Finding, says: str, do: str = "") -> bool:
    return found.level == "fault" and says in found.says and do in found.do


def test_good_keys_are_good(issued: Keys) -> None:
    bundle, found = read_bundle(issued["post"].folder)
    assert bundle is not None
    assert [one.level for one in (*found, *validity(bundle, time_ns()))] == ["ok"] * 3
    assert names_host(bundle, "127.0.0.1").level == "ok"
    assert names_host(bundle, "0.0.0.0").level == "ok"  # noqa: S104
    assert is_fault(names_host(bundle, "192.168.7.11"), "does not name", "--host 192.168.7.11")


def time_ns() -> int:
    return SystemClock().now_ns()


def test_keys_that_others_may_read_are_told(issued: Keys) -> None:
    folder = issued["post"].folder
    (folder / "private.key").chmod(0o644)
    bundle, (found,) = read_bundle(folder)
    assert bundle is None
    assert is_fault(found, "others may read", "chmod 600")


def test_keys_that_are_missing_are_told(tmp_path: Path) -> None:
    _, (found,) = read_bundle(tmp_path / "nowhere")
    assert is_fault(found, "nowhere", "command-post keys issue")


def test_keys_out_of_their_time_are_told(issued: Keys) -> None:
    expired = issued.date("post", end=now() - timedelta(days=1))
    assert any(is_fault(one, "expired", "renew") for one in validity(expired, time_ns()))
    coming = issued.date("post", begin=now() + timedelta(days=1))
    assert any(is_fault(one, "not valid before", "clock") for one in validity(coming, time_ns()))
    soon = issued.date("post", end=now() + timedelta(hours=3))
    assert "warning" in [one.level for one in validity(soon, time_ns())]


def test_a_port_is_free_or_in_use() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        endpoint = f"{ELSEWHERE}:{server.getsockname()[1]}"
        (found,) = can_listen(endpoint, None)
        assert is_fault(found, "in use", "another port")
    (found,) = can_listen(endpoint, None)
    assert found.level == "ok"


def test_where_nobody_can_listen_is_told(issued: Keys) -> None:
    (found,) = can_listen("tcp/10.0.0.1:7447", None)
    assert is_fault(found, "without --keys")
    *_, found = can_listen("tls/192.0.2.7:7447", issued["post"])
    assert is_fault(found, "no address of this machine")


def test_who_knows_us_answers(issued: Keys) -> None:
    with secured(issued["post"]) as endpoint:
        assert can_dial(endpoint, issued["r1"]).level == "ok"


def test_a_stranger_is_told_to_be_one(issued: Keys, tmp_path: Path) -> None:
    others = Keys(tmp_path / "others")
    with secured(issued["post"]) as endpoint:
        found = can_dial(endpoint, others["r1"])
    assert is_fault(found, "not by our authority", "one authority")


def test_a_node_out_of_its_time_is_told_from_either_side(issued: Keys) -> None:
    expired = issued.date("r1", end=now() - timedelta(days=1))
    with secured(issued["post"]) as endpoint:
        assert is_fault(can_dial(endpoint, expired), "refuses our certificate", "renew")
    with secured(issued.date("post", end=now() - timedelta(days=1))) as endpoint:
        assert is_fault(can_dial(endpoint, issued["dap1"]), "has expired", "renew")


def test_a_node_under_another_name_is_told(issued: Keys) -> None:
    with secured(issued["post"]) as endpoint:
        found = can_dial(endpoint.replace("127.0.0.1", "127.0.0.2"), issued["r1"])
    assert is_fault(found, "nobody listens") or is_fault(found, "not for 127.0.0.2", "--host")


def test_plain_where_tls_is_expected_and_the_reverse(issued: Keys) -> None:
    with open_zenoh("router", listen=["tcp/127.0.0.1:0"]) as bus:
        (locator,) = bus.locators()
        assert can_dial(locator, None).level == "ok"
        found = can_dial(locator.replace("tcp/", "tls/"), issued["r1"])
        assert is_fault(found, "no word of TLS", "--keys")
    with secured(issued["post"]) as endpoint:
        assert is_fault(can_dial(endpoint.replace("tls/", "tcp/"), None), "speaks TLS", "--keys")


def test_nobody_at_home_is_told() -> None:
    assert is_fault(can_dial(free_endpoint(), None), "nobody listens", "start")
    assert is_fault(can_dial("localhost:1", None), "write tcp/HOST:PORT")


def test_a_clock_that_was_never_set_is_told() -> None:
    (found,) = check_clock(50 * 365 * 86_400)
    assert is_fault(found, "1970", "set it")
    assert next(iter(check_clock(time_ns()))).level == "ok"


def test_the_posts_clock_is_compared() -> None:
    with open_zenoh("router", listen=["tcp/127.0.0.1:0"]) as bus:
        (locator,) = bus.locators()
        ahead = PacedClock(ManualClock(time_ns() + 40 * NS_PER_S))
        bus.answer(time_key("fire", "p"), time_answerer(ahead))
        found = check_post_clock(locator, None, "fire")
        assert found.level == "warning"
        assert "ahead" in found.says


def test_the_disk_is_told_of(tmp_path: Path) -> None:
    record = tmp_path / "fire.mcap"
    assert "fault" not in [one.level for one in check_recording(record)]
    record.with_name("fire.mcap.part").write_bytes(b"1")
    assert "broken off" in next(iter(check_recording(record))).says
    record.touch()
    assert is_fault(next(iter(check_recording(record))), "there already", "another name")
    *_, found = check_recording(tmp_path / "no folder" / "fire.mcap")
    assert is_fault(found, "no folder", "make it")
    assert {path.name for path in tmp_path.iterdir()} == {"fire.mcap", "fire.mcap.part"}


def test_this_python_is_good_enough() -> None:
    assert [one.level for one in check_packages()] == ["ok", "ok"]


def test_the_exit_code_says_whether_a_post_would_work(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    record = tmp_path / "fire.mcap"
    plan = tmp_path / "plan.geojson"
    plan.write_text("{}")

    def run(*arguments: object) -> tuple[int, list[dict[str, str]]]:
        given = ["doctor", "--record", record, "--listen", free_endpoint(), *arguments]
        code = app([*map(str, given)], exit_on_error=False, result_action="return_value")
        findings = json.loads(capfd.readouterr().out)["findings"]
        assert isinstance(findings, list)
        return code, findings

    code, findings = run("--json")
    assert code == ExitCode.OK
    assert {"python", "disk", "clock"} <= {found["about"] for found in findings}
    code, findings = run("--json", "--plan", plan)
    assert code == ExitCode.FAILURE
    assert [found["about"] for found in findings if found["level"] == "fault"] == ["plan"]
