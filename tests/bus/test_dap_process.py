"""``dap-node run`` as others meet it: a process on the network."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager

from shared.bus.interface import Received
from shared.bus.zenoh_bus import open_zenoh
from shared.codec import Refusal, decode, encode, parse_key
from shared.messages import ExerciseStart, Message, ProximityEvent
from shared.simulation.installation import installation_truth
from shared.simulation.scenario import load_scenario
from shared.topics import alive_key, everything_of
from shared.units import NS_PER_S
from tests.bus.test_zenoh import free_endpoint
from tests.waiting import DEADLINE_S, wait_for

SEED = 4
TOKEN = alive_key("test", "dap", "dap2")


@contextmanager
def dap_node(endpoint: str) -> Iterator[subprocess.Popen[bytes]]:
    """Run dap2 of the stairwell, which dials ``endpoint`` and waits for the exercise."""
    command = [sys.executable, "-m", "dap_node", "run", "--insecure", "--id", "dap2",
               "--incident", "test",
               "--source", "simulated:stairwell", "--seed", str(SEED), "--await-start",
               "--connect", endpoint]  # fmt: skip
    with subprocess.Popen(command, stderr=subprocess.PIPE) as process:
        try:
            yield process
        finally:
            process.kill()


def messages_of(heard: list[Received], topic: str) -> list[Message]:
    found = []
    for received in tuple(heard):
        key = parse_key(received.key)
        assert not isinstance(key, Refusal)
        if key.topic == topic:
            message = decode(key, received.payload)
            assert not isinstance(message, Refusal)
            found.append(message)
    return found


def phases_of(heard: list[Received]) -> list[str]:
    events = messages_of(heard, "proximity")
    return [event.phase for event in events if isinstance(event, ProximityEvent)]


def test_started_before_the_post_it_takes_part_to_the_end() -> None:
    endpoint = free_endpoint()
    with dap_node(endpoint) as process, open_zenoh("router", listen=[endpoint]) as post:
        heard: list[Received] = []
        alive: list[tuple[str, bool]] = []
        post.subscribe(everything_of("test"), heard.append)
        post.watch_alive(TOKEN, lambda key, is_alive: alive.append((key, is_alive)))
        wait_for(lambda: alive == [(TOKEN, True)], "the DAP")
        start_ns = time.time_ns()
        start = ExerciseStart(
            event_time_ns=start_ns, sequence=0, scenario="stairwell", seed=SEED, speed=1000.0
        )
        post.answer("clew/v1/test/post/launcher/exercise", lambda _: encode(start))
        assert process.wait(DEADLINE_S) == 0
        wait_for(lambda: alive[1:] == [(TOKEN, False)], "the token to go")
        wait_for(lambda: phases_of(heard)[-1:] == ["left"], "the last stay to end")
    time_s, _, _ = installation_truth(load_scenario("stairwell"), "dap2", SEED)
    (installation,) = messages_of(heard, "installation")
    assert installation.event_time_ns == start_ns + round(time_s * NS_PER_S)
    assert phases_of(heard)[0] == "entered"
    assert messages_of(heard, "rssi")


def test_asked_to_stop_while_it_waits_it_goes_quietly() -> None:
    endpoint = free_endpoint()
    with open_zenoh("router", listen=[endpoint]) as post, dap_node(endpoint) as process:
        alive: list[tuple[str, bool]] = []
        post.watch_alive(TOKEN, lambda key, is_alive: alive.append((key, is_alive)))
        wait_for(lambda: alive, "the DAP")
        process.send_signal(signal.SIGTERM)
        assert process.wait(DEADLINE_S) == 0
        assert process.stderr is not None
        assert b"Traceback" not in process.stderr.read()
