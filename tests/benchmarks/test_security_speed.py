"""What signing, checking and encrypting cost."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import cycle
from pathlib import Path

import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from shared.bus.zenoh_bus import open_zenoh
from shared.codec import encode
from shared.gate import Gate
from shared.security.verifier import KnownSigners
from shared.sender import Unkept
from shared.topics import TOPICS
from tests.issued_keys import Keys, identity
from tests.traffic import increment
from tests.waiting import wait_for

KEY = "clew/v1/fire/responder/r1/increment"
TOPIC = TOPICS["increment"]
MESSAGES = 20_000


@pytest.fixture
def keys(tmp_path: Path) -> Keys:
    return Keys(tmp_path / "keys", ["post", "r1"])


def said(keys: Keys | None) -> Iterator[bytes]:
    """Yield strides as r1 says them, signed where there are keys."""
    outbox = Unkept(keys["r1"].sign if keys else None)
    for number in range(MESSAGES):
        yield outbox.seal(TOPIC, KEY, encode(increment(number)))


@pytest.mark.parametrize("signs", [False, True])
def test_sealing(benchmark: BenchmarkFixture, keys: Keys, signs: bool) -> None:
    outbox = Unkept(keys["r1"].sign if signs else None)
    payload = encode(increment(0))
    sealed = benchmark(lambda: outbox.seal(TOPIC, KEY, payload))
    assert len(sealed) > len(payload)


@pytest.mark.parametrize("checks", [False, True])
def test_letting_in(benchmark: BenchmarkFixture, keys: Keys, checks: bool) -> None:
    signers = KnownSigners(keys["post"].authority, lambda: 0)
    assert signers.learn(keys["r1"].certificate.der, identity("r1")) is None
    gate = Gate(signers if checks else None)
    messages = cycle(list(said(keys if checks else None)))
    benchmark(lambda: gate.admit(KEY, next(messages)))
    assert not {why for why, _ in gate.turned} - {"repeated"}


def test_learning_a_certificate(benchmark: BenchmarkFixture, keys: Keys) -> None:
    signers, der = KnownSigners(keys["post"].authority, lambda: 0), keys["r1"].certificate.der
    assert benchmark(lambda: signers.learn(der)) is None


@pytest.mark.parametrize("protocol", ["tcp", "tls"])
def test_a_question_and_its_answer(benchmark: BenchmarkFixture, keys: Keys, protocol: str) -> None:
    post, r1 = (keys[name] if protocol == "tls" else None for name in ("post", "r1"))
    key = "clew/v1/fire/post/post/time"
    with (
        open_zenoh("router", (), [f"{protocol}/127.0.0.1:0"], post) as router,
        open_zenoh("client", router.locators(), bundle=r1) as client,
    ):
        router.answer(key, lambda request: request)
        wait_for(lambda: client.query(key, 1.0), "an answer")
        assert benchmark(lambda: client.query(key, 1.0, bytes(200)))
