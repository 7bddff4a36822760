"""A mayday at a real agent, pressed while its link is cut: the commander and TAK have it soon."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from command_post.gateways.tak import TakServer, linked_to_tak
from command_post.web.page import Page
from edge_agent.__main__ import app
from shared.bus.zenoh_bus import open_zenoh
from shared.process import ExitCode
from tests.bus.relay import Relay
from tests.bus.test_zenoh import port_of
from tests.faults.test_orders_on_bad_links import FIRE, post_at_work
from tests.gateways.test_tak import ORIGIN, Client, pytestmark, server
from tests.waiting import DEADLINE_S, wait_for

__all__ = ["pytestmark", "server"]


def test_a_mayday_without_a_link_reaches_the_alerts_and_tak_once_there_is_one(
    tmp_path: Path,
    server: tuple[str, int],
) -> None:
    page, client, journal = Page(FIRE), Client(server[1]), tmp_path / "r1.journal"
    with (
        open_zenoh("router", listen=["tcp/127.0.0.1:0"]) as router,
        linked_to_tak(TakServer(server[0]), FIRE, ORIGIN) as tak,
        post_at_work(router, tmp_path / "a.mcap", [page, *([tak] if tak else [])]) as shown,
        Relay(port_of(router.locators()[0])) as relay,
        subprocess.Popen(
            [sys.executable, "-m", "edge_agent", "run", "--insecure", "--incident", FIRE,
             "--connect", f"tcp/127.0.0.1:{relay.port}", "--id", "r1", "--no-imu",
             "--source", "simulated:four_daps", "--journal", str(journal)],
            stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
        ) as agent,
    ):  # fmt: skip
        try:
            wait_for(lambda: shown and shown[-1].responders, "the agent", 3 * DEADLINE_S)
            relay.cut()
            code = app(
                ["mayday", "--id", "r1", "--journal", str(journal), "--wait", "0.2"],
                exit_on_error=False, result_action="return_value",
            )  # fmt: skip
            assert code == ExitCode.FAILURE, "nobody can have heard it"
            assert not page.since(0).alerts
            relay.mend()
            wait_for(lambda: page.since(0).alerts, "the alert")
            (alert,) = page.since(0).alerts
            assert (alert.kind, alert.node_id, alert.stage) == ("mayday", "r1", "raised")
            wait_for(lambda: b"911 Alert" in client.heard, "the emergency in TAK")
            assert agent.stdout is not None
            lines = [agent.stdout.readline() for _ in range(2)]
            assert lines == [b"MAYDAY CALLED\n", b"MAYDAY HEARD\n"]
        finally:
            agent.kill()
            client.close()
