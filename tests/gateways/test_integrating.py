"""What docs/integrating.md shows is run as it stands there, beside a post's end of the wire."""

from __future__ import annotations

import re
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import jsonschema
import msgspec
import pytest

from shared.bus.interface import Bus
from shared.bus.zenoh_bus import open_zenoh
from shared.codec import decode, encode, parse_key
from shared.gate import Gate
from shared.introductions import Introductions
from shared.messages import Beat, Message, OdometryIncrement, TrackEstimate, TrackStart
from shared.sender import Sender, Unkept
from shared.topics import TOPICS, Key, everything_of
from shared.vocabulary import schemas
from tests.issued_keys import Keys
from tests.stride_world import stride
from tests.waiting import wait_for
from tests.wire_messages import INCIDENT

PAGE = Path(__file__).parents[2] / "docs" / "integrating.md"
WATCH, UNIT = re.findall(r"```python\n(.*?)```", PAGE.read_text(), re.DOTALL)
ESTIMATE = TrackEstimate(
    event_time_ns=1, sequence=0, responder_id="r1", north_m=3.0, east_m=-4.0, down_m=-5.0,
    covariance_m2=(1.0, 0.0, 1.0), heading_rad=0.0, heading_sd_rad=0.1, last_proximity_time_ns=None,
)  # fmt: skip


class Enough(Exception):  # noqa: N818 - nothing is wrong
    """The program has said what it was to say."""


@contextmanager
def post(keys: Keys) -> Iterator[tuple[Bus, Introductions, str]]:
    """Give a post's bus, whom it knows, and where it listens."""
    bundle = keys["post"]
    with (
        open_zenoh("router", listen=["tls/127.0.0.1:0"], bundle=bundle) as bus,
        Introductions(bus, INCIDENT, bundle) as introductions,
    ):
        (endpoint,) = bus.locators()
        yield bus, introductions, endpoint


def test_the_watcher_prints_what_a_post_says(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    keys = Keys(tmp_path, ("post", "commander"))
    said: list[tuple[object, ...]] = []
    stop = threading.Event()

    def told(*words: object, flush: bool) -> None:
        assert flush
        said.append(words)
        raise Enough

    with post(keys) as (bus, _, endpoint):
        sender = Sender(bus, INCIDENT, "post", "post", Unkept(keys["post"].sign))

        def go_on_saying() -> None:
            while not stop.wait(0.02):
                now_ns = time.time_ns()
                sender.send(msgspec.structs.replace(ESTIMATE, event_time_ns=now_ns))

        # No daemon: it is inside Zenoh when it publishes.
        saying = threading.Thread(target=go_on_saying)
        saying.start()
        folder = str(keys["commander"].folder)
        monkeypatch.setattr(sys, "argv", ["watch.py", folder, endpoint, INCIDENT])
        try:
            with pytest.raises(Enough):
                exec(WATCH, {"__name__": "watch", "print": told})  # noqa: S102
        finally:
            stop.set()
            saying.join()
    assert said == [("r1", "tracking", 3.0, -4.0, 5.0)]


def test_a_unit_of_another_kind_is_let_in(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    keys = Keys(tmp_path, ("post", "r1"))
    heard: list[tuple[str, bytes]] = []
    with post(keys) as (bus, introductions, endpoint):
        bus.subscribe(everything_of(INCIDENT), lambda received: heard.append(received[:2]))
        journal = str(tmp_path / "r1.journal")
        words = ["unit.py", str(keys["r1"].folder), endpoint, INCIDENT, journal]
        monkeypatch.setattr(sys, "argv", words)
        exec(UNIT.replace("wait(1.0)", "wait(0.05)"), {"__name__": "unit"})  # noqa: S102
        signers = introductions.signers
        wait_for(lambda: Gate(signers).admit(*heard[-1]) is None, "the unit to be known")
        gate = Gate(signers)
        let_in = [_message(each) for each in heard if gate.admit(*each) is None]
    # What it said before it had a link is in its journal, which a post asks for.
    assert {type(each) for each in let_in} <= {TrackStart, OdometryIncrement, Beat}
    assert any(isinstance(each, Beat) and each.last_number == 11 for each in let_in)
    north_m = [each.d_north_m for each in let_in if isinstance(each, OdometryIncrement)]
    assert north_m
    assert set(north_m) == {1.0}


def _message(heard: tuple[str, bytes]) -> Message:
    key = parse_key(heard[0])
    assert isinstance(key, Key)
    message = decode(key, heard[1])
    assert isinstance(message, Message)
    return message


@pytest.mark.parametrize(("field", "good"), [("d_north_m", 0.7), ("d_north_m", 1e9), ("mount", 3)])
def test_the_schema_says_what_is_let_in(field: str, good: object) -> None:
    told = schemas()
    assert set(told["topics"]) == set(TOPICS)
    document = {**told["topics"]["increment"], "$defs": told["$defs"]}
    said = msgspec.msgpack.decode(encode(stride(0.0, 1.0, 0.0))) | {field: good}
    key = Key(INCIDENT, "responder", "r1", "increment")
    is_let_in = isinstance(decode(key, msgspec.msgpack.encode(said)), OdometryIncrement)
    assert jsonschema.Draft202012Validator(document).is_valid(said) == is_let_in == (good == 0.7)
