"""A post, DAPs and agents as the very programs they are, to be killed and started again.

On loopback, or each with the network of a station in the ``Air``. When all is done, what is in
their journals is held against the post's recording.
"""

from __future__ import annotations

import math
import os
import signal
import sqlite3
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple, Self

from command_post.authority import Authority
from edge_agent.sources.mcap_recording import read_imu_samples
from shared.bus.loopback import free_ports
from shared.mcap_reader import read_recording
from shared.security.certificates import Identity
from shared.topics import Role
from shared.units import NS_PER_S
from tests.faults.air import Air
from tests.issued_keys import DAYS, now
from tests.machine_code import build_machine_code
from tests.waiting import wait_for

INCIDENT = "fault"
COMMANDER = "commander"
TWIN = "twin"
"""Another post by the id of the first: to be started on loopback."""

SCENARIO = "four_daps"
STOP_S = 20.0
WALK = Path(__file__).resolve().parent.parent.parent / "recordings" / "corridor.mcap"


class Program(NamedTuple):
    """How one node is started; ``station`` is where it is in the air, if there is any.

    ``environment`` is what it finds in its environment beside what all do.
    """

    name: str
    module: str
    arguments: tuple[str, ...]
    station: str | None = None
    environment: Mapping[str, str] = MappingProxyType({})


class Fleet:
    """The processes of an incident, each under its name; ``folder`` takes their logs.

    Leaving the ``with`` block kills what still runs.
    """

    def __init__(self, folder: Path, programs: Iterable[Program], air: Air | None = None) -> None:
        self._folder = folder
        self._air = air
        self._programs = {program.name: program for program in programs}
        self._running: dict[str, subprocess.Popen[bytes]] = {}

    def start(self, *names: str) -> None:
        """Start these, or all; what runs already goes on."""
        for name in names or self._programs:
            if name not in self._running:
                self._running[name] = self._started(self._programs[name])

    def change(self, program: Program) -> None:
        """Have a node be started otherwise from now on."""
        self._programs[program.name] = program

    def kill(self, *names: str) -> None:
        """Kill these as a power cut does: SIGKILL, all at one moment."""
        killed = [self._running.pop(name) for name in names]
        for process in killed:
            process.kill()
        for process in killed:
            process.wait()

    def stop(self, *names: str) -> dict[str, int]:
        """Ask these, or all, to stop, and return how they ended."""
        chosen = names or tuple(self._running)
        stopping = {name: self._running.pop(name) for name in chosen}
        for process in stopping.values():
            process.send_signal(signal.SIGTERM)
        return {name: process.wait(STOP_S) for name, process in stopping.items()}

    def stop_s(self, number: signal.Signals) -> dict[str, float]:
        """Ask all to stop by a signal at one moment; return how long each took."""
        stopping, self._running = self._running, {}
        asked_s = time.monotonic()
        for process in stopping.values():
            process.send_signal(number)
        took_s: dict[str, float] = {}

        def all_ended() -> bool:
            for name, process in stopping.items():
                if name not in took_s and process.poll() is not None:
                    took_s[name] = time.monotonic() - asked_s
            return len(took_s) == len(stopping)

        wait_for(all_ended, "all to end", STOP_S)
        assert {process.returncode for process in stopping.values()} == {0}
        return took_s

    def ended(self) -> list[str]:
        """Return who has ended of themselves."""
        return [name for name, process in self._running.items() if process.poll() is not None]

    def log(self, name: str) -> str:
        """Return what a program has said on standard error, over all its lives."""
        return self._log(name).read_text()

    def __enter__(self) -> Self:
        self._folder.mkdir(parents=True, exist_ok=True)
        build_machine_code()
        return self

    def __exit__(self, *_: object) -> None:
        self.kill(*tuple(self._running))

    def _started(self, program: Program) -> subprocess.Popen[bytes]:
        command = [sys.executable, "-m", program.module, *program.arguments]
        environment = {**os.environ, **program.environment}
        with self._log(program.name).open("ab") as log:
            if self._air is not None and program.station is not None:
                return self._air.start(program.station, command, stdin=subprocess.DEVNULL,
                                       stdout=log, stderr=log, env=environment)  # fmt: skip
            return subprocess.Popen(
                command, stdin=subprocess.DEVNULL, stdout=log, stderr=log, env=environment
            )

    def _log(self, name: str) -> Path:
        return self._folder / f"{name}.log"


class Deployment:
    """Where the nodes of an incident are, their keys and their files.

    Without ``air`` all are on loopback, on ports that are free. All agents walk the
    same way.
    """

    def __init__(
        self,
        folder: Path,
        daps: Sequence[str],
        responders: Sequence[str],
        air: Air | None = None,
        *,
        walk_s: float = 600.0,
        disk: Path | None = None,
    ) -> None:
        """``walk_s``: for how long an agent's sensor has something to say.

        ``disk`` is where recordings and journals are, if not in ``folder`` with the rest.
        """
        self._disk = folder if disk is None else disk
        self.folder, self.daps, self.responders = folder, tuple(daps), tuple(responders)
        self._air = air
        folder.mkdir(parents=True, exist_ok=True)
        routers = ("post", *daps)
        ports = dict.fromkeys(routers, 7447)
        if air is None:
            everybody = (*routers, TWIN)
            ports = dict(zip(everybody, free_ports(len(everybody)), strict=True))
        self._endpoints = {
            name: f"tls/{'127.0.0.1' if air is None else air.address(name)}:{ports[name]}"
            for name in ports
        }
        self._walk = write_walk(folder / "walk.csv", walk_s)
        authority = Authority.create(folder / "keys", now())
        for name in (*routers, *responders, COMMANDER):
            role: Role = "responder" if name in responders else "dap" if name in daps else "post"
            hosts = () if air is None or name not in routers else (air.address(name),)
            authority.issue([Identity(role, name)], hosts, now(), DAYS)

    @property
    def recording(self) -> Path:
        """Where the post records."""
        return self._disk / "incident.mcap"

    def journal(self, name: str) -> Path:
        """Return where a node has its journal."""
        return self._disk / f"{name}.journal"

    @property
    def journals(self) -> list[Path]:
        """The journals of all DAPs and responders."""
        return [self.journal(name) for name in (*self.daps, *self.responders)]

    def post(self, recording: Path | None = None) -> Program:
        """Return how the post is started."""
        return self._post("post", recording or self.recording)

    @property
    def twins_recording(self) -> Path:
        """Where the post's twin records."""
        return self._disk / "twin.mcap"

    def twin(self) -> Program:
        """Return how another post is started that goes by the post's id, with its keys."""
        return self._post(TWIN, self.twins_recording)

    def dap(self, name: str, *dials: str) -> Program:
        """Return how a DAP is started that dials those."""
        journal = ("--source", f"simulated:{SCENARIO}", "--journal", str(self.journal(name)))
        return self._program(name, "dap_node", journal, *dials, at=name)

    def agent(self, name: str, *dials: str) -> Program:
        """Return how a responder's agent is started that dials those."""
        source = ("--source", f"csv:{self._walk}", "--no-imu")
        journal = (*source, "--journal", str(self.journal(name)))
        return self._program(name, "edge_agent", journal, *dials)

    def as_commander(self, post: str = "post") -> tuple[str, ...]:
        """Return how ``command-post order`` and the like are told who says it, and to whom."""
        return ("--incident", INCIDENT, "--id", COMMANDER, "--connect", self._endpoints[post],
                "--keys", str(self.folder / "keys" / COMMANDER))  # fmt: skip

    def _post(self, at: str, recording: Path) -> Program:
        record = ("--record", str(recording))
        return self._program("post", "command_post", record, at=at)._replace(name=at)

    def _program(
        self, name: str, module: str, own: tuple[str, ...], *dials: str, at: str | None = None
    ) -> Program:
        """Return how the node ``name`` is started; it listens where ``at`` is to be found."""
        common = ("run", "--id", name, "--incident", INCIDENT, "--keys",
                  str(self.folder / "keys" / name))  # fmt: skip
        listen = () if at is None else ("--listen", self._endpoints[at])
        dialled = (part for dial in dials for part in ("--connect", self._endpoints[dial]))
        station = None if self._air is None else name
        return Program(name, module, (*common, *own, *listen, *dialled), station)


class Account(NamedTuple):
    """What became of all that was journalled: see ``account``."""

    journalled: int
    lost: int
    repeated: int


def account(recording: Path, journals: Sequence[Path]) -> Account:
    """Hold each journal's messages against what was received by the recording."""
    received = Counter(
        (message.key, message.payload)
        for message in read_recording(recording)
        if not message.outgoing
    )
    said = [each for path in journals for each in rows_of(path)]
    return Account(
        journalled=len(said),
        lost=sum(received[each] == 0 for each in said),
        repeated=sum(received[each] > 1 for each in said),
    )


def rows_of(journal: Path) -> list[tuple[str, bytes]]:
    """Return the keys and bytes of a journal, which its node may be writing."""
    return _read(journal, "SELECT key, payload FROM message ORDER BY number")


def is_safe(journal: Path) -> bool:
    """Whether the post has acknowledged all that is in a journal."""
    found = _read(
        journal, "SELECT acknowledged = (SELECT ifnull(max(number), 0) FROM message) FROM about"
    )
    return found == [(1,)]


def acknowledged(journal: Path) -> int:
    """Return how many messages of a journal the post has acknowledged."""
    return sum(number for (number,) in _read(journal, "SELECT acknowledged FROM about"))


def _read(journal: Path, query: str) -> list[Any]:
    """Return what ``query`` finds; nothing in a file that its node is only just making, or will."""
    if not journal.exists():
        return []
    connection = sqlite3.connect(f"file:{journal}?mode=ro", uri=True)
    try:
        made = connection.execute("SELECT 1 FROM sqlite_master WHERE name = 'message'").fetchall()
        return connection.execute(query).fetchall() if made else []
    finally:
        connection.close()


def write_walk(path: Path, lasts_s: float) -> Path:
    """Write a walk of half a minute, again and again, as an x-io sensor exports it."""
    samples = list(read_imu_samples(WALK, "r1"))
    begin_ns, period_ns = samples[0].time_ns, samples[1].time_ns - samples[0].time_ns
    once_ns = samples[-1].time_ns - begin_ns + period_ns
    header = "Time (s),Gyroscope X (rad/s),Gyroscope Y (rad/s),Gyroscope Z (rad/s),"
    with path.open("w") as file:
        file.write(
            header + "Accelerometer X (m/s2),Accelerometer Y (m/s2),Accelerometer Z (m/s2)\n"
        )
        for again in range(math.ceil(lasts_s * NS_PER_S / once_ns)):
            for sample in samples:
                time_s = (sample.time_ns - begin_ns + again * once_ns) / NS_PER_S
                readings = (*sample.rate_rad_s, *sample.force_m_s2)
                file.write(",".join([f"{time_s:.4f}", *(f"{each:.6g}" for each in readings)]))
                file.write("\n")
    return path
