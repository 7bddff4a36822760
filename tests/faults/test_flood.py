"""A node that floods the post, which it is free to do, and what the others notice of it."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from msgspec import structs
from pytest_benchmark.fixture import BenchmarkFixture

from command_post.fusion.methods import prepare_fusion
from command_post.fusion.settings import FusionSettings
from shared.bus.zenoh_bus import open_zenoh
from shared.codec import Refusal, decode, parse_key
from shared.mcap_reader import RecordedMessage, read_recording
from shared.messages import OdometryIncrement
from shared.sender import Sender
from shared.topics import alive_key
from shared.units import NS_PER_S
from tests.bus.test_zenoh import free_endpoint
from tests.traffic import increment
from tests.waiting import DEADLINE_S, wait_for

WALKING = ("r1", "r2")
MEGABYTE = 1 << 20
MOST_GROWN_BYTES = 200 * MEGABYTE
MOST_EVIDENCE_BYTES = 4 * MEGABYTE


@contextmanager
def post(folder: Path, endpoint: str) -> Iterator[subprocess.Popen[bytes]]:
    command = [sys.executable, "-m", "command_post", "run", "--insecure", "--incident", "fire",
               "--record", str(folder / "fire.mcap"), "--listen", endpoint]  # fmt: skip
    with (folder / "log").open("wb") as log, subprocess.Popen(command, stderr=log) as process:
        try:
            yield process
        finally:
            process.kill()


def peak_bytes(process: subprocess.Popen[bytes]) -> int:
    """Return the most memory that a process ever held."""
    for line in Path(f"/proc/{process.pid}/status").read_text().splitlines():
        if line.startswith("VmHWM:"):
            return int(line.split()[1]) * 1024
    raise AssertionError("no peak memory told")


def flooding(endpoint: str, seconds: float) -> subprocess.Popen[bytes]:
    command = [sys.executable, "-m", "tests.faults.flooder", endpoint, "fire", "mad", str(seconds)]
    return subprocess.Popen(command, stdout=subprocess.PIPE)


def strides_of(responder: str, recorded: Iterable[RecordedMessage]) -> list[RecordedMessage]:
    return [one for one in recorded if f"/{responder}/increment" in one.key]


def sequence_of(recorded: RecordedMessage) -> int:
    key = parse_key(recorded.key)
    assert not isinstance(key, Refusal)
    message = decode(key, recorded.payload)
    assert isinstance(message, OdometryIncrement)
    return message.sequence


def all_recorded(recording: Path, strides: int) -> bool:
    so_far = list(read_recording(recording))
    return all(len(strides_of(responder, so_far)) >= strides for responder in WALKING)


@pytest.fixture(scope="module", autouse=True)
def _prepared() -> None:
    prepare_fusion(FusionSettings())


class Flooded(NamedTuple):
    """What came of a flood: what was sent, and what the post made of it."""

    sent: dict[str, float]
    grown_bytes: int
    recording: list[RecordedMessage]
    log: str


def flooded_post(folder: Path, seconds: float, strides: int) -> Flooded:
    """Have two responders walk while a third node floods their post for ``seconds``."""
    endpoint = free_endpoint()
    with post(folder, endpoint) as served, open_zenoh("client", connect=[endpoint]) as bus:
        alive: list[str] = []
        bus.watch_alive(alive_key("fire", "post", "post"), lambda key, _: alive.append(key))
        wait_for(lambda: alive, "the post")
        before_bytes = peak_bytes(served)
        senders = [Sender(bus, "fire", "responder", responder) for responder in WALKING]
        with flooding(endpoint, seconds) as flood:
            for number in range(strides):
                for sender in senders:
                    sender.send(stride_now(number))
                # Nothing is waited for: this is how fast they walk.
                time.sleep(seconds / strides)
            said, _ = flood.communicate(timeout=DEADLINE_S)
        wait_for(lambda: all_recorded(folder / "fire.mcap.part", strides), "the last strides")
        grown_bytes = peak_bytes(served) - before_bytes
        served.send_signal(signal.SIGTERM)
        assert served.wait(DEADLINE_S) == 0
    recording = list(read_recording(folder / "fire.mcap"))
    return Flooded(json.loads(said), grown_bytes, recording, (folder / "log").read_text())


def stride_now(number: int) -> OdometryIncrement:
    now_ns = time.time_ns()
    return structs.replace(increment(number), event_time_ns=now_ns, start_time_ns=now_ns - 1)


@pytest.mark.skipif(not Path("/proc").is_dir(), reason="needs /proc to see a process's memory")
def test_a_flood_of_garbage_costs_the_others_nothing(
    tmp_path: Path, benchmark: BenchmarkFixture
) -> None:
    seconds, strides = (30.0, 300) if benchmark.enabled else (4.0, 80)
    flooded: Flooded = benchmark.pedantic(  # type: ignore[no-untyped-call]
        lambda: flooded_post(tmp_path, seconds, strides), rounds=1, iterations=1
    )
    late_s = []
    for responder in WALKING:
        heard = strides_of(responder, flooded.recording)
        assert [sequence_of(one) for one in heard] == list(range(strides)), "all, once, in order"
        late_s += [(one.log_time_ns - one.publish_time_ns) / NS_PER_S for one in heard]
    evidence = [len(one.payload) for one in flooded.recording if "/mad/" in one.key]
    assert evidence
    assert sum(evidence) < MOST_EVIDENCE_BYTES
    assert flooded.grown_bytes < MOST_GROWN_BYTES
    assert "floods" in flooded.log
    assert "Traceback" not in flooded.log
    median_s, slow_s = np.percentile(late_s, [50.0, 99.0])
    benchmark.extra_info.update(
        messages_per_s=round(flooded.sent["per_s"]),
        megabytes_per_s=round(flooded.sent["bytes"] / seconds / 1e6),
        others_latency_p50_s=round(float(median_s), 4),
        others_latency_p99_s=round(float(slow_s), 3),
        memory_grown_mb=round(flooded.grown_bytes / MEGABYTE, 1),
    )
    if benchmark.enabled:
        assert slow_s < 1.0
