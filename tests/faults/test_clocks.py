"""Units whose clocks are wrong, and set while they run: there is one time line all the same."""

from __future__ import annotations

import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest

from command_post.nodes.node_clock import KnownClock
from command_post.nodes.senders import Senders
from shared.codec import Refusal, decode, parse_key
from shared.journal import Journal
from shared.mcap_reader import read_recording
from shared.messages import Message
from shared.seal import read_seal
from shared.topics import TOPICS, Key
from shared.units import NS_PER_S
from tests.bus.test_zenoh import free_endpoint
from tests.faults.fleet import rows_of
from tests.machine_code import build_machine_code
from tests.waiting import DEADLINE_S, wait_for

FOR_TEST = ("--insecure", "--incident", "test")
MS = 1_000_000
SLEWED_NS = 5 * MS
"""What the machine's own clock may be put right by between the starts of two processes."""


@pytest.fixture(scope="module", autouse=True)
def _built() -> None:
    build_machine_code()


@contextmanager
def running(*command: str) -> Iterator[subprocess.Popen[bytes]]:
    """Run a program until the block ends, and kill it then if it still runs."""
    with subprocess.Popen(
        [sys.executable, "-m", *command], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    ) as process:
        try:
            yield process
        finally:
            process.kill()


def post_at(endpoint: str, recording: Path) -> tuple[str, ...]:
    return ("command_post", "run", *FOR_TEST, "--listen", endpoint, "--record", str(recording))


def agent_at(
    endpoint: str, journal: Path, ahead_s: float, responder_id: str = "r1"
) -> tuple[str, ...]:
    """Return the command for an agent whose clock is ahead."""
    where = ("--connect", endpoint, "--source", "simulated:four_daps", "--journal", str(journal))
    begin = ("tests.faults.wrong_clock", str(ahead_s), "run")
    return (*begin, *FOR_TEST, "--id", responder_id, "--no-imu", *where)


def heard_in(recording: Path) -> Iterator[tuple[int, Key, Message, bytes]]:
    """Yield what was received, and when."""
    for each in read_recording(recording):
        key = parse_key(each.key)
        assert isinstance(key, Key)
        message = decode(key, each.payload)
        assert not isinstance(message, Refusal)
        if not each.outgoing:
            yield each.log_time_ns, key, message, each.payload


def known_clocks(recording: Path) -> dict[str, KnownClock]:
    """Return what an unfinished recording tells of the units' clocks that state it."""
    if not recording.exists() or recording.stat().st_size < 1000:
        return {}
    senders = Senders(0)
    for now_ns, key, message, payload in heard_in(recording):
        if key.role == "responder":
            senders.hear(key, message, now_ns, read_seal(payload))
    clocks = {each: senders.clock("responder", each) for each in ("r1", "r2", "r3")}
    return {
        each: known
        for each, known in clocks.items()
        if known is not None and known.uncertainty_ns is not None
    }


def last_number_in(recording: Path) -> int:
    """Return the newest number of what the unit's journal holds, as far as it was recorded."""
    seals = (
        read_seal(payload)
        for _, key, _, payload in heard_in(recording)
        if key.role == "responder" and TOPICS[key.topic].journalled
    )
    return max((seal.number for seal in seals if seal is not None), default=0)


def test_clocks_that_are_off_and_set_later_are_known_to_milliseconds(tmp_path: Path) -> None:
    endpoint, recording = free_endpoint(), tmp_path / "a.mcap"
    unfinished = tmp_path / "a.mcap.part"
    ahead_s = {"r1": -40.0, "r2": 3 * 3600.0, "r3": -86_400.0}
    with running(*post_at(endpoint, recording)) as post, ExitStack() as agents:
        for each, by_s in ahead_s.items():
            agent = agent_at(endpoint, tmp_path / f"{each}.journal", by_s, each)
            agents.enter_context(running(*agent))
        wait_for(lambda: len(known_clocks(unfinished)) == 3, "all clocks stated", 5 * DEADLINE_S)
        post.send_signal(signal.SIGTERM)
        assert post.wait(DEADLINE_S) == 0
    for each, known in known_clocks(recording).items():
        assert known.uncertainty_ns is not None
        assert abs(known.offset_ns + ahead_s[each] * NS_PER_S) <= known.uncertainty_ns + SLEWED_NS
        assert known.uncertainty_ns <= 500 * MS


def last_number(journal: Path) -> int:
    """Return the newest number in a journal that nobody has open."""
    kept = Journal(journal)
    try:
        return kept.holding().last_number
    finally:
        kept.close()


def test_what_was_dated_before_a_restart_keeps_the_offset_of_its_own(tmp_path: Path) -> None:
    endpoint, recording = free_endpoint(), tmp_path / "a.mcap"
    journal = tmp_path / "r1.journal"
    # Nobody is there to hear the first of them.
    with running(*agent_at(endpoint, journal, -40.0)) as first:
        wait_for(lambda: journal.exists() and len(rows_of(journal)) > 2, "rows", 3 * DEADLINE_S)
        first.kill()
        first.wait()
    of_the_first = last_number(journal)
    with (
        running(*post_at(endpoint, recording)) as post,
        running(*agent_at(endpoint, journal, 3600.0)),
    ):
        wait_for(lambda: known_clocks(tmp_path / "a.mcap.part"), "a statement", 3 * DEADLINE_S)
        wait_for(lambda: last_number_in(tmp_path / "a.mcap.part") > of_the_first, "new strides")
        post.send_signal(signal.SIGTERM)
        assert post.wait(DEADLINE_S) == 0
    senders = Senders(0)
    journalled = []
    for now_ns, key, message, payload in heard_in(recording):
        seal = read_seal(payload)
        if key.role == "responder" and seal is not None:
            senders.hear(key, message, now_ns, seal)
            if TOPICS[key.topic].journalled:
                journalled.append((message, seal))
    numbers = {seal.number for _, seal in journalled}
    assert min(numbers) <= of_the_first < max(numbers)
    for message, seal in journalled:
        dated_ns = senders.time_ns("responder", "r1", message.event_time_ns, seal)
        wrong_by_s = -40.0 if seal.number <= of_the_first else 3600.0
        right_ns = message.event_time_ns - round(wrong_by_s * NS_PER_S)
        assert abs(dated_ns - right_ns) <= 500 * MS
