"""Nodes learn who the others are, from whoever hands the certificates on."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest
from structlog.testing import capture_logs

from shared import introductions
from shared.bus.memory import MemoryBus, MemoryNetwork
from shared.codec import encode
from shared.gate import Gate
from shared.introductions import Introductions
from shared.sender import Unkept
from shared.topics import TOPICS, certificate_key
from tests.issued_keys import Keys, identity
from tests.traffic import increment
from tests.waiting import wait_for

KEY = "clew/v1/fire/responder/r1/increment"


class Crew:
    """Nodes that introduce themselves over one network."""

    def __init__(self, folder: Path, opened: ExitStack) -> None:
        self.keys = Keys(folder / "keys", ["post", "r1", "r2"])
        self.network = MemoryNetwork()
        self._opened = opened

    def join(self, name: str) -> Introductions:
        """Have ``name`` come."""
        bundle = self.keys[name]
        return self._opened.enter_context(Introductions(self.network.connect(), "fire", bundle))

    def said(self) -> bytes:
        """Return what r1 says."""
        return Unkept(self.keys["r1"].sign).seal(TOPICS["increment"], KEY, encode(increment(0)))


def answer_with(bus: MemoryBus, der: bytes) -> None:
    bus.answer(certificate_key("fire", "responder", "r1"), lambda _: der)


@pytest.fixture
def crew(tmp_path: Path) -> Iterator[Crew]:
    with ExitStack() as opened:
        yield Crew(tmp_path, opened)


def test_who_introduces_itself_is_known_at_once(crew: Crew) -> None:
    post, r1 = crew.join("post"), crew.join("r1")
    assert r1.introduce()
    assert Gate(post.signers).admit(KEY, crew.said()) is None


def test_who_is_not_known_is_asked(crew: Crew, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(introductions, "ASK_AGAIN_S", 0.0)
    monkeypatch.setattr(introductions, "POLL_S", 0.01)
    gate = Gate(crew.join("r2").signers)
    assert gate.admit(KEY, crew.said()) == "unknown_signer"
    crew.join("r1")
    wait_for(lambda: gate.admit(KEY, crew.said()) in (None, "repeated"), "r1 to be known")


def test_no_impostor_hides_the_true_one(crew: Crew, tmp_path: Path) -> None:
    foreign = Keys(tmp_path / "others", ["r1"])["r1"]
    for der in (foreign.certificate.der, crew.keys["r2"].certificate.der, b"nonsense"):
        answer_with(crew.network.connect(), der)
    post = crew.join("post")
    with capture_logs() as logs:
        assert not post.meet(identity("r1"))
        assert not post.meet(identity("r1"))
    assert sorted(each["reason"] for each in logs) == ["foreign", "renamed", "unreadable"]
    crew.join("r1")
    assert post.meet(identity("r1"))
    assert Gate(post.signers).admit(KEY, crew.said()) is None


def test_a_made_up_introduction_is_counted(crew: Crew) -> None:
    post = crew.join("post")
    with capture_logs():
        crew.network.connect().query(certificate_key("fire", "post", "*"), 1.0, b"nonsense")
    assert post.signers is not None
    assert post.signers.refused.total() == 1


def test_a_flood_of_introductions_is_not_looked_into(
    crew: Crew, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(introductions, "MOST_AT_ONCE", 5.0)
    monkeypatch.setattr(introductions, "MOST_PER_S", 0.0)
    post, stranger = crew.join("post"), crew.network.connect()
    with capture_logs():
        for _ in range(50):
            (answer,) = stranger.query(certificate_key("fire", "post", "*"), 1.0, b"nonsense")
    assert answer.payload == crew.keys["post"].certificate.der
    assert post.signers is not None
    assert post.signers.refused.total() <= 5


def test_without_keys_everybody_is_believed(crew: Crew) -> None:
    with Introductions(crew.network.connect(), "fire", None) as alone:
        assert alone.introduce()
        assert alone.meet(identity("r1"))
        assert alone.signers is None
