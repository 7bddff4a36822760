"""What befalls machines, not links: clocks that are set, a full disk, a post that is there twice.

As ``ordeals``: ``python -m tests.faults ORDEAL`` runs one.
"""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple
from urllib.request import urlopen

from shared.bus.loopback import free_ports
from tests.faults.fleet import INCIDENT, TWIN, Deployment, Fleet, Program, account, is_safe
from tests.faults.ordeals import PATIENCE_S, Outcome, ended, has_said, programs_of
from tests.faults.set_clock import clock_set_by, set_clock
from tests.faults.small_disk import fill, small_disk
from tests.waiting import wait_for

DISK_BYTES = 4 << 20
TOO_LITTLE = "No space left on device"
IN_MEMORY_ONLY = "nothing goes into the journal"
ANOTHER_POST = "another post goes by post too"


def clock_steps(folder: Path, steps_s: Sequence[float]) -> Outcome:
    """Set everybody's clock ahead and back while they run, each after the other.

    With the last step the post is killed as well, and comes back in another time zone.
    """
    site = Deployment(folder, ["dap1"], ["r1"])
    files = {name: folder / f"{name}.ahead" for name in ("post", "dap1", "r1")}
    programs = [
        clock_set_by(files[program.name], _in_zone(program, "Asia/Kathmandu"))
        for program in programs_of(site)
    ]
    with Fleet(folder / "logs", programs) as fleet:
        fleet.start()
        has_said(site, 3)
        for ahead_s in steps_s:
            for file in files.values():
                set_clock(file, ahead_s)
                has_said(site, 2)
        fleet.kill("post")
        fleet.change(_in_zone(programs[0], "America/St_Johns"))
        fleet.start("post")
        has_said(site, 3)
        return ended(site, fleet, since_ns=0)


def _in_zone(program: Program, zone: str) -> Program:
    return program._replace(environment={**program.environment, "TZ": zone})


def full_disk(folder: Path) -> Outcome:
    """Fill the disk of post and agent at once, and make room again.

    Both must say so and go on; what the agent could not write is kept in its memory.
    """
    disk = folder / "disk"
    disk.mkdir(parents=True)
    with small_disk(disk, DISK_BYTES):
        site = Deployment(folder, [], ["r1"], disk=disk)
        (port,) = free_ports(1)
        programs = [_told_at(site.post(), port), site.agent("r1", "post")]
        with Fleet(folder / "logs", programs) as fleet:
            fleet.start()
            has_said(site, 3)
            wait_for(lambda: is_safe(site.journal("r1")), "a receipt", PATIENCE_S)
            ballast = disk / "ballast"

            def is_full() -> bool:
                fill(ballast)
                return TOO_LITTLE in _remarks(port) and IN_MEMORY_ONLY in fleet.log("r1")

            wait_for(is_full, "both to say that their disk is full", PATIENCE_S)
            ballast.unlink()
            wait_for(lambda: not _remarks(port), "the recording to go on", PATIENCE_S)
            wait_for(lambda: "written again" in fleet.log("r1"), "the journal", PATIENCE_S)
            has_said(site, 3)
            return ended(site, fleet, since_ns=0)


def two_posts(folder: Path) -> Outcome:
    """Start another post by the id of the first, with its keys; end it again.

    Both must say so and have all, and who stays must still be heeded.
    """
    site = Deployment(folder, ["dap1"], ["r1"])
    ports = free_ports(2)
    programs = [
        _told_at(site.post(), ports[0]), _told_at(site.twin(), ports[1]),
        site.dap("dap1", "post", TWIN), site.agent("r1", "dap1"),
    ]  # fmt: skip
    with Fleet(folder / "logs", programs) as fleet:
        fleet.start("post", "dap1", "r1")
        has_said(site, 3)
        wait_for(lambda: is_safe(site.journal("r1")), "a receipt", PATIENCE_S)
        _order(site, "from the first")
        fleet.start(TWIN)
        for port in ports:
            wait_for(lambda: ANOTHER_POST in _remarks(port), "the remark", PATIENCE_S)  # noqa: B023
        _order(site, "from the twin", TWIN)
        wait_for(lambda: "from the twin" in fleet.log("r1"), "its order", PATIENCE_S)
        assert fleet.stop(TWIN) == {TWIN: 0}
        _order(site, "from who stays")
        wait_for(lambda: "from who stays" in fleet.log("r1"), "the order", PATIENCE_S)
        outcome = ended(site, fleet, since_ns=0)
        for post in ("post", TWIN):
            assert f"clew/v1/{INCIDENT}/post/post/" in fleet.log(post), "the log tells of it"
    assert account(site.twins_recording, site.journals).repeated == 0
    return outcome


class Stops(NamedTuple):
    """How long each program took at most to stop, beside the others."""

    longest_s: dict[str, float]


def stops(folder: Path, times: int) -> Stops:
    """Have everybody work, and stop at one moment: by SIGTERM, SIGINT, and so on in turn."""
    site = Deployment(folder, ["dap1", "dap2"], ["r1", "r2", "r3"], walk_s=60.0 * times)
    page, figures = (f"127.0.0.1:{port}" for port in free_ports(2))
    longest_s: dict[str, float] = {}
    with Fleet(folder / "logs", programs_of(site)) as fleet:
        for number in range(times):
            post = site.post(folder / f"{number}.mcap")
            shown = ("--page", page, "--metrics", figures)
            fleet.change(post._replace(arguments=(*post.arguments, *shown)))
            fleet.start()
            has_said(site, 5)
            took_s = fleet.stop_s((signal.SIGTERM, signal.SIGINT)[number % 2])
            longest_s = {name: max(each, longest_s.get(name, 0.0)) for name, each in took_s.items()}
    return Stops({name: round(each, 2) for name, each in longest_s.items()})


def _order(site: Deployment, text: str, post: str = "post") -> None:
    """Have a post order something of the responder."""
    order = ("order", "message", "--to", "r1", "--text", text)
    command = [sys.executable, "-m", "command_post", *order, *site.as_commander(post)]
    subprocess.run(command, check=True, capture_output=True)


def _told_at(program: Program, port: int) -> Program:
    """Return a post that tells its roster at a port."""
    return program._replace(arguments=(*program.arguments, "--metrics", f"127.0.0.1:{port}"))


def _remarks(port: int) -> str:
    """Return what a post's roster has to say that is no node's matter."""
    with urlopen(f"http://127.0.0.1:{port}/roster", timeout=PATIENCE_S) as answer:
        return "; ".join(json.load(answer)["remarks"])
