"""A DAP with keys is told that it stands: by a commander's click, and by who set it down."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import Event, Thread

import pytest
from cyclopts import App

from command_post.__main__ import app as post_app
from command_post.commands import orders
from dap_node.node import DapNode
from edge_agent.__main__ import app as agent_app
from shared.bus.zenoh_bus import open_zenoh
from shared.gate import Gate
from shared.introductions import Introductions
from shared.process import ExitCode
from shared.radios.readings import RadioScan
from shared.sender import Unkept
from shared.topics import alive_key
from tests.issued_keys import Keys
from tests.waiting import wait_for


def run(app: App, command: list[str]) -> object:
    return app(command, exit_on_error=False, result_action="return_value")


@contextmanager
def dap_at_work(keys: Keys) -> Iterator[tuple[DapNode, str]]:
    """Give dap1, which takes a scan every few milliseconds, and where to dial it."""
    bundle, stop = keys["dap1"], Event()
    with (
        open_zenoh("router", listen=["tls/127.0.0.1:0"], bundle=bundle) as bus,
        Introductions(bus, "fire", bundle) as introductions,
    ):
        node = DapNode(
            bus, "fire", "dap1", outbox=Unkept(bundle.sign), gate=Gate(introductions.signers)
        )

        def work() -> None:
            while not stop.wait(0.02):
                node.take(RadioScan(time.time_ns(), ()))

        thread = Thread(target=work)
        thread.start()
        try:
            yield node, bus.locators()[0]
        finally:
            stop.set()
            thread.join()


def test_it_stands_as_it_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(orders, "ANSWER_S", 20.0)
    keys = Keys(tmp_path / "keys", ["post", "commander", "dap1", "r1"])
    with (
        dap_at_work(keys) as (node, endpoint),
        open_zenoh("client", [endpoint], bundle=keys["post"]) as post,
        Introductions(post, "fire", keys["post"]),
    ):
        post.declare_alive(alive_key("fire", "post", "post"))
        told = ["set-down", "--incident", "fire", "--connect", endpoint, "--dap", "dap1"]
        by_agent = [*told, "--id", "r1", "--keys", str(keys["r1"].folder)]
        assert run(agent_app, by_agent) == ExitCode.OK
        wait_for(lambda: node.stage == "installed", "the DAP to stand beside r1")
        by_click = [*told, "--keys", str(keys["commander"].folder), "--north", "3", "--east=-1"]
        assert run(post_app, by_click) == ExitCode.OK
        assert node.stage == "placed"
