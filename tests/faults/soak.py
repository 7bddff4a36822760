"""Does anything leak? Long-lived nodes in a hurry, with an eye on what each process holds.

``python -m tests.faults.soak --hours 24 --speed 60`` runs a post, a DAP that relays, two units that
say ``speed`` strides a second each through it (``--strides`` times as many), journalled and
acknowledged, and a third agent, a whole one, that comes and goes over and over. That lasts
``hours / speed`` real hours. It prints JSON, an object a line: what each process holds over time,
and at the end by how much that grew from the first quarter to the last. Descriptors and threads
must not grow at all. The post's horizon is so many times as near, and the parts of its recording
are as much shorter, so that memory is to be flat since those were full: the line through it since
then must not rise by more than 1 % of it in an hour of the incident.

What a post does not get to waits in its memory, as it should: a machine that is too slow, or busy
with other work, shows as ``most_waiting`` messages, and says nothing of leaks.
"""

from __future__ import annotations

import argparse
import json
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple
from urllib.request import urlopen

from shared.bus.loopback import free_ports
from shared.process import ExitCode
from shared.recording_parts import files_of
from tests.bus.test_zenoh import free_endpoint
from tests.waiting import wait_for

SAMPLES = 240
HORIZON_MIN, LATENESS_MIN, PART_H = 40.0, 60.0, 1.0
FULL_H = 6.0
"""By then all is kept that is kept for a while: the horizon, what may come late, buffers."""

MOST_GROWTH = 0.01
"""Of a process' memory, in an hour of the incident."""

MOST_WAITING = 2000
"""Messages: with more the post does not keep up."""

STARTED_S = 300.0
SETTLED_S = 15.0
"""A process that has just started still grows into its work."""

WALKING = ("w1", "w2")
VISITOR = "r1"
INCIDENT = "soak"


class Held(NamedTuple):
    """What a process holds of the machine."""

    memory_mb: float
    descriptors: int
    threads: int


def held_by(pid: int) -> Held | None:
    """Return what a process holds; ``None`` if it is no more."""
    process = Path("/proc") / str(pid)
    try:
        lines = (process / "status").read_text().splitlines()
        status = dict(line.split(":", 1) for line in lines)
        descriptors = len(list((process / "fd").iterdir()))
        return Held(int(status["VmRSS"].split()[0]) / 1024.0, descriptors, int(status["Threads"]))
    except (OSError, KeyError):
        return None


class Nodes:
    """The processes of a soak, each with a log of its own."""

    def __init__(self, folder: Path, speed: float, strides: float) -> None:
        self._folder = folder
        self._speed = speed
        self._strides = strides
        self._endpoints = {"post": free_endpoint(), "dap1": free_endpoint()}
        self._metrics = f"127.0.0.1:{free_ports(1)[0]}"
        self.processes: dict[str, subprocess.Popen[bytes]] = {}
        self.visits = 0

    def start(self) -> None:
        """Start all, those that are dialled first, once nobody has to build machine code."""
        for program in ("command_post", "edge_agent"):
            subprocess.run([sys.executable, "-m", program, "prepare"], check=True)
        of_incident = ("--incident", INCIDENT, "--insecure", "--with-parent")
        post, dap = self._endpoints["post"], self._endpoints["dap1"]
        self._run("post", "command_post", "run", *of_incident, "--listen", post,
                  "--record", str(self._folder / "soak.mcap"), "--metrics", self._metrics,
                  "--rotate-hours", str(PART_H / self._speed),
                  "--horizon", str(HORIZON_MIN / self._speed),
                  "--lateness", str(LATENESS_MIN / self._speed))  # fmt: skip
        self._run("dap1", "dap_node", "run", *of_incident, "--id", "dap1", "--await-start",
                  "--source", "simulated:corridor", "--listen", dap, "--connect", post)  # fmt: skip
        for name in WALKING:
            journal = str(self._folder / f"{name}.journal")
            self._run(name, "tests.faults.talker", dap, INCIDENT, name, journal,
                      str(self._strides * self._speed))  # fmt: skip

    def waiting(self) -> int:
        """Return how many messages the post has not got to; 0 where it does not say so."""
        return self._waiting() or 0

    def is_up(self) -> bool:
        """Say whether the post is at work."""
        return self._waiting() is not None

    def _waiting(self) -> int | None:
        with suppress(OSError), urlopen(f"http://{self._metrics}/metrics", timeout=5.0) as told:
            for line in told.read().decode().splitlines():
                if line.startswith("clew_inbox_messages "):
                    return round(float(line.split()[1]))
        return None

    def receive_visitor(self) -> None:
        """Have the visitor come if they are not here."""
        here = self.processes.get(VISITOR)
        if here is None or here.poll() is not None:
            self.visits += 1
            self._run(VISITOR, "edge_agent", "run", "--id", VISITOR, "--source",
                      "simulated:corridor", "--speed", "10", "--connect", self._endpoints["dap1"],
                      "--incident", INCIDENT, "--insecure", "--with-parent")  # fmt: skip

    def ended(self) -> dict[str, int]:
        """Return the exit codes of those who should not have ended, or not so."""
        codes = {name: process.poll() for name, process in self.processes.items()}
        return {
            name: code
            for name, code in codes.items()
            if code is not None and (code != 0 or name != VISITOR)
        }

    def stop(self) -> dict[str, int]:
        """Ask all to stop, those who dial first; return their exit codes."""
        for process in reversed(self.processes.values()):
            process.send_signal(signal.SIGTERM)
            process.wait()
        return {name: process.returncode for name, process in self.processes.items()}

    def _run(self, name: str, *command: str) -> None:
        with (self._folder / f"{name}.log").open("ab") as log:
            self.processes[name] = subprocess.Popen(
                [sys.executable, "-m", *command], stdin=subprocess.PIPE, stdout=log, stderr=log
            )


def soak(folder: Path, hours: float, speed: float, strides: float) -> bool:
    """Run the nodes and print what they hold; return whether all ended well, and nothing leaked."""
    real_s = hours * 3600.0 / speed
    period_s = max(real_s / SAMPLES, 1.0)
    series: dict[str, list[Held]] = {}
    since_full: dict[str, list[tuple[float, float]]] = {}
    most_waiting = 0
    nodes = Nodes(folder, speed, strides)
    nodes.start()
    wait_for(nodes.is_up, "the post to be there", STARTED_S)
    began_s = time.monotonic()
    while (since_s := time.monotonic() - began_s) < real_s and not nodes.ended():
        nodes.receive_visitor()
        now = {name: held_by(process.pid) for name, process in nodes.processes.items()}
        for name, held in now.items():
            if held is not None and name != VISITOR and since_s > SETTLED_S:
                series.setdefault(name, []).append(held)
                if since_s * speed > FULL_H * 3600.0:
                    at_h = since_s * speed / 3600.0
                    since_full.setdefault(name, []).append((at_h, held.memory_mb))
        told = {name: held._asdict() for name, held in now.items() if held is not None}
        waiting = nodes.waiting()
        most_waiting = max(most_waiting, waiting)
        _tell(
            {"real_s": round(since_s, 1), "visits": nodes.visits, "waiting": waiting, "held": told}
        )
        time.sleep(period_s)
    ended, codes = nodes.ended(), nodes.stop()
    growth = {name: grown(held) for name, held in series.items()}
    risen = {name: rise(each) for name, each in since_full.items() if len(each) > 2}
    is_flat = not any(max(each["descriptors"], each["threads"]) > 0 for each in growth.values())
    is_flat &= all(each.mb_an_hour < MOST_GROWTH * each.mean_mb for each in risen.values())
    recorded_mb = sum(each.stat().st_size for each in files_of(folder / "soak.mcap").values()) / 1e6
    risen_mb = {name: each._asdict() for name, each in risen.items()}
    said = {"grown": growth, "since_full": risen_mb, "flat": is_flat, "recorded_mb": recorded_mb}
    _tell({**said, "most_waiting": most_waiting, "ended_early": ended, "exit_codes": codes})
    if codes.get(VISITOR) == ExitCode.INTERRUPTED:
        # They were only just coming.
        del codes[VISITOR]
    return most_waiting <= MOST_WAITING and is_flat and not ended and not any(codes.values())


class Rise(NamedTuple):
    """The line through memory over hours: its mean, and by how much it rises in one."""

    mean_mb: float
    mb_an_hour: float


def rise(memory: list[tuple[float, float]]) -> Rise:
    """Return how memory rises, of pairs of hours and MB."""
    at_h, memory_mb = zip(*memory, strict=True)
    slope, _ = statistics.linear_regression(at_h, memory_mb)
    return Rise(round(statistics.fmean(memory_mb), 1), round(slope, 3))


def grown(series: list[Held]) -> dict[str, float]:
    """Return by how much the last quarter exceeds the first: memory's medians, else the least.

    While a visitor is there, who serves them holds a descriptor and a thread or two more.
    """
    quarter = max(1, len(series) // 4)
    (memory, *first), (memory_then, *last) = (
        (
            statistics.median(held.memory_mb for held in part),
            min(held.descriptors for held in part),
            min(held.threads for held in part),
        )
        for part in (series[:quarter], series[-quarter:])
    )
    more = [now - then for now, then in zip(last, first, strict=True)]
    return dict(zip(Held._fields, (round(memory_then - memory, 2), *more), strict=True))


def _tell(what: dict[str, object]) -> None:
    print(json.dumps(what), flush=True)  # noqa: T201


def main() -> int:
    """Run the command line."""
    parser = argparse.ArgumentParser(prog="python -m tests.faults.soak", description=__doc__)
    parser.add_argument(
        "--hours", type=float, default=24.0, help="of an incident at its usual pace"
    )
    parser.add_argument("--speed", type=float, default=60.0, help="times as fast as real")
    parser.add_argument("--strides", type=float, default=1.0, help="a second of each, at that pace")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="clew-soak-") as folder:
        return 0 if soak(Path(folder), given.hours, given.speed, given.strides) else 1


if __name__ == "__main__":
    sys.exit(main())
