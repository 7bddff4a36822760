"""How soon a post is back that is killed amid a long incident.

``python -m tests.faults.taking_up --minutes 60 --responders 12`` makes a recording of so many
minutes that ends now, in a hurry and by the post's own handlers; starts ``command-post run``, which
takes it up, and goes on walking; kills it with SIGKILL just before it would keep its state again;
and starts it once more, by the same command, in a place where everybody goes on talking. It prints
as JSON how long after that start the first estimate of a stride made since was heard of everybody,
on the bus. With ``--unfit`` the state is gone, as with other software.
"""

from __future__ import annotations

import argparse
import json
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import NamedTuple

import numpy as np
from msgspec import structs

from command_post.fusion.methods import prepare_fusion
from command_post.incident import Incident, IncidentSettings
from command_post.recorder.recording import RecordedIncident, Recorder
from command_post.resuming.beside import before_path
from command_post.resuming.checkpoint import Checkpoints, State, checkpoint_path
from shared.bus.interface import Received
from shared.bus.zenoh_bus import ZenohBus
from shared.codec import decode, encode, parse_key
from shared.gate import Gate
from shared.heartbeat import Heartbeat
from shared.messages import Message, OdometryIncrement, TrackEstimate
from shared.outbox import JournalledOutbox
from shared.sender import Sender
from shared.topics import Key, Role, alive_key
from shared.units import NS_PER_S
from tests.benchmarks.crowd import START_NS, Said, crowd
from tests.benchmarks.test_team_speed import role_of, topic_of
from tests.bus.test_zenoh import free_endpoint
from tests.waiting import let_last, wait_for

INCIDENT = "fire"
CREW = 12
STEPS_A_SECOND = 1.0
GOES_ON_MINUTES = 30.0
"""The walk goes on for so much longer: while it is recorded, taken up and gone on with."""

PATIENCE_S = 1200.0
MOST_BETWEEN_S = 90.0


class Back(NamedTuple):
    """How soon a post was back, from its start: seconds until everybody's estimates.

    ``first_s`` is when the first was heard of anybody, ``all_s`` when of all a stride was fused
    that was made since the kill.
    """

    responders: int
    recorded_minutes: float
    recorded_mb: float
    kept_mb: float
    kept_every_s: float
    age_of_kept_s: float
    first_s: float
    all_s: float
    said: list[str]


class Walk:
    """What everybody says, its beginning being ``begin_ns``, in the order of its time."""

    def __init__(self, responders: int, minutes: float, begin_ns: int) -> None:
        crews = [min(CREW, responders - first) for first in range(0, responders, CREW)]
        self._said = crowd(crews, 0, minutes + GOES_ON_MINUTES, STEPS_A_SECOND, 2, within_s=40.0)
        self._shift_ns = begin_ns - START_NS
        self.next = self._shifted(next(self._said))
        """What is said next."""

    def until(self, time_ns: int) -> Iterator[Said]:
        """Yield what is said until then, and was not given before."""
        while self.next.message.event_time_ns <= time_ns:
            said, self.next = self.next, self._shifted(next(self._said))
            yield said

    def _shifted(self, said: Said) -> Said:
        message = said.message
        time_ns = message.event_time_ns + self._shift_ns
        if isinstance(message, OdometryIncrement):
            start_ns = message.start_time_ns + self._shift_ns
            return Said(
                said.node_id,
                structs.replace(message, event_time_ns=time_ns, start_time_ns=start_ns),
            )
        return Said(said.node_id, structs.replace(message, event_time_ns=time_ns))


def record(walk: Walk, path: Path) -> int:
    """Record at ``path`` all until now, as a post would, and leave it unfinished; return how much.

    What is said while it is recorded is recorded as well, until the present is reached.
    """
    settings = IncidentSettings(incident=INCIDENT)
    prepare_fusion(settings.fusion)
    incident, chance, count = Incident(settings), np.random.default_rng(1), 0
    handled_ns = 0
    with suppress(InterruptedError), Recorder(path, settings.as_metadata()) as recorder:
        recorded = RecordedIncident(incident, recorder)
        while walk.next.message.event_time_ns < time.time_ns() - NS_PER_S // 10:
            for node_id, message in walk.until(time.time_ns() - NS_PER_S // 10):
                arrives_ns = message.event_time_ns + round(chance.uniform(0.005, 0.06) * NS_PER_S)
                handled_ns = max(handled_ns, arrives_ns)
                recorded.handle(_key(node_id, message), encode(message), handled_ns)
                count += 1
                wait_for(lambda: recorder.has_room, "the disk", PATIENCE_S)
        checkpoints = Checkpoints(checkpoint_path(path), recorder)
        checkpoints.keep(State(incident, Gate().remembered(), None, handled_ns))
        wait_for(checkpoint_path(path).exists, "the state to be kept", PATIENCE_S)
        raise InterruptedError
    return count


class Site:
    """A post that can be killed, everybody who walks on meanwhile, and somebody who listens."""

    def __init__(self, folder: Path, walk: Walk) -> None:
        self._folder = folder
        self._walk = walk
        self._endpoint = free_endpoint()
        self.recording = folder / "long.mcap"
        self.log = folder / "post.log"
        self._post: subprocess.Popen[bytes] | None = None
        self._began_s = 0.0
        self._killed_ns = 0
        self._stop = threading.Event()
        self.first_s: dict[str, float] = {}
        """When, after the last start, an estimate of each was heard."""

        self.fresh_s: dict[str, float] = {}
        """When one was heard of a stride made since the last kill."""

    def start(self) -> None:
        """Start the post, always by the same command."""
        self.first_s, self.fresh_s = {}, {}
        self._began_s = time.monotonic()
        command = ("run", "--insecure", "--incident", INCIDENT, "--listen", self._endpoint,
                   "--record", str(self.recording), "--with-parent")  # fmt: skip
        with self.log.open("ab") as log:
            self._post = subprocess.Popen(
                [sys.executable, "-m", "command_post", *command],
                stdin=subprocess.PIPE, stdout=log, stderr=log,
            )  # fmt: skip

    def kill(self) -> None:
        """Kill the post as nothing can be caught."""
        assert self._post is not None
        self._post.kill()
        self._post.wait()
        self._killed_ns = time.time_ns()

    def stop(self) -> int:
        """Have the post end by itself; return what its exit says."""
        assert self._post is not None
        self._post.send_signal(signal.SIGTERM)
        return self._post.wait(PATIENCE_S)

    def talk(self) -> threading.Thread:
        """Have everybody say what they have to say as it happens, journalled, until ``hush``."""
        thread = threading.Thread(target=self._talk)
        thread.start()
        return thread

    def hush(self) -> None:
        """Have nobody say anything any more."""
        self._stop.set()

    def _talk(self) -> None:
        with ExitStack() as stack:
            bus = stack.enter_context(ZenohBus("client", [self._endpoint], []))
            bus.subscribe(str(Key(INCIDENT, "post", "post", "track")), self._hear)
            senders: dict[str, Sender] = {}
            while not self._stop.wait(0.05):
                for node_id, message in self._walk.until(time.time_ns()):
                    if node_id not in senders:
                        senders[node_id] = self._introduced(stack, bus, node_id)
                    senders[node_id].send(message)

    def _introduced(self, stack: ExitStack, bus: ZenohBus, node_id: str) -> Sender:
        role: Role = "dap" if node_id.startswith("dap") else "responder"
        outbox = stack.enter_context(JournalledOutbox(self._folder / f"{node_id}.journal"))
        bus.declare_alive(alive_key(INCIDENT, role, node_id))
        stack.enter_context(Heartbeat(bus, INCIDENT, role, node_id, outbox))
        return Sender(bus, INCIDENT, role, node_id, outbox)

    def _hear(self, received: Received) -> None:
        key = parse_key(received.key)
        estimate = decode(key, received.payload) if isinstance(key, Key) else None
        if isinstance(estimate, TrackEstimate):
            since_s = time.monotonic() - self._began_s
            self.first_s.setdefault(estimate.responder_id, since_s)
            if estimate.event_time_ns > self._killed_ns:
                self.fresh_s.setdefault(estimate.responder_id, since_s)


def taken_up(folder: Path, responders: int, minutes: float, *, unfit: bool) -> Back:
    """Let it happen in ``folder``."""
    walk = Walk(responders, minutes, time.time_ns() - round(minutes * 60) * NS_PER_S)
    site = Site(folder, walk)
    begin_ns = walk.next.message.event_time_ns
    record(walk, site.recording)
    site.start()
    talking = site.talk()
    try:
        wait_for(lambda: len(site.fresh_s) == responders, "everybody's estimates", PATIENCE_S)
        kept = checkpoint_path(site.recording)
        every_s = _until_about_to_be_kept(kept)
        age_s = time.time() - _kept_at_s(kept)
        site.kill()
        part = site.recording.with_name(f"{site.recording.name}.part")
        recorded_mb, kept_mb = (each.stat().st_size / 1e6 for each in (part, kept))
        if unfit:
            for each in (kept, before_path(kept)):
                each.unlink(missing_ok=True)
        recorded_minutes = (time.time_ns() - begin_ns) / NS_PER_S / 60.0
        site.start()
        wait_for(lambda: len(site.fresh_s) == responders, "everybody's estimates", PATIENCE_S)
        back = Back(
            responders, recorded_minutes, recorded_mb, kept_mb, every_s, age_s,
            min(site.first_s.values()), max(site.fresh_s.values()),
            _said(site.log.read_text().splitlines()),
        )  # fmt: skip
    finally:
        site.hush()
        talking.join()
        site.stop()
    return back


def _kept_at_s(kept: Path) -> float:
    """Return when the state was kept last; amid being kept it is the one before."""
    with suppress(FileNotFoundError):
        return kept.stat().st_mtime
    return before_path(kept).stat().st_mtime


def _until_about_to_be_kept(kept: Path) -> float:
    """Wait until just before the state is kept again; return how often it is."""
    times_s = [_kept_at_s(kept)]
    while len(times_s) < 3:
        began_s = time.monotonic()
        while _kept_at_s(kept) == times_s[-1] and time.monotonic() < began_s + MOST_BETWEEN_S:
            let_last(0.05)
        times_s.append(_kept_at_s(kept))
    every_s = times_s[-1] - times_s[-2]
    let_last(0.9 * min(every_s, MOST_BETWEEN_S))
    return every_s


def _said(lines: Sequence[str]) -> list[str]:
    return [line for line in lines if "taken up" in line or "state" in line]


def _key(node_id: str, message: Message) -> str:
    return str(Key(INCIDENT, role_of(message), node_id, topic_of(message)))


def main() -> int:
    """Run the command line."""
    parser = argparse.ArgumentParser(prog="python -m tests.faults.taking_up", description=__doc__)
    parser.add_argument("--minutes", type=float, default=60.0, help="recorded at least")
    parser.add_argument("--responders", type=int, default=12)
    parser.add_argument("--unfit", action="store_true", help="as if by other software")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="clew-taking-up-") as folder:
        back = taken_up(Path(folder), given.responders, given.minutes, unfit=given.unfit)
    print(json.dumps(back._asdict()), flush=True)  # noqa: T201
    return 0


if __name__ == "__main__":
    sys.exit(main())
