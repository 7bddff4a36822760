"""A message is believed if its own node signed it, with a key that is vouched for now."""

from __future__ import annotations

from datetime import timedelta
from pathlib import Path

import pytest

from shared.codec import encode
from shared.gate import MOST_TURNED, UNNAMED, Gate
from shared.messages import Message
from shared.security.bundle import Bundle
from shared.security.verifier import MOST_WANTED, KnownSigners
from shared.sender import Unkept
from shared.topics import TOPICS
from shared.units import NS_PER_S
from tests.issued_keys import DAYS, Keys, identity, now
from tests.traffic import increment

KEY = "clew/v1/fire/responder/{}/increment"
DAY = timedelta(days=1)


class Shown:
    """A receiver whose clock is turned at will, and keys for others."""

    def __init__(self, folder: Path) -> None:
        self.keys = Keys(folder, ["r1", "r2", "dap1"])
        self.now_ns = round(now().timestamp()) * NS_PER_S
        self.known = KnownSigners(self.keys["dap1"].authority, lambda: self.now_ns)
        self.gate = Gate(self.known)

    def said(self, signer: str = "r1", under: str = "r1") -> tuple[str, bytes]:
        """Return a message under the keys of ``under`` that ``signer`` has signed."""
        return message(self.keys[signer], KEY.format(under))

    def show(self, bundle: Bundle, of: str = "r1") -> str | None:
        """Show the certificate of ``bundle``; return what is wrong with it."""
        return self.known.learn(bundle.certificate.der, identity(of))


def message(signer: Bundle, key: str) -> tuple[str, bytes]:
    said: Message = increment(0)
    return key, Unkept(signer.sign).seal(TOPICS["increment"], key, encode(said))


@pytest.fixture
def shown(tmp_path: Path) -> Shown:
    return Shown(tmp_path / "keys")


def test_who_is_not_known_is_wanted_and_then_believed(shown: Shown) -> None:
    said = shown.said()
    assert shown.gate.admit(*said) == "unknown_signer"
    assert shown.known.take_wanted() == [identity("r1")]
    assert shown.known.take_wanted() == []
    assert shown.show(shown.keys["r1"]) is None
    assert shown.gate.admit(*said) is None
    assert shown.gate.admit(*said) == "repeated"


@pytest.mark.parametrize("at", [1, 10, -70, -80, -90, -1, -64])
def test_what_is_altered_is_forged(shown: Shown, at: int) -> None:
    shown.show(shown.keys["r1"])
    key, whole = shown.said()
    changed = whole[:at] + bytes([whole[at] ^ 1]) + whole[at:][1:]
    assert shown.gate.admit(key, changed) in ("forged", "unsealed")
    assert shown.gate.admit(key, whole) is None


def test_nobody_speaks_for_another(shown: Shown) -> None:
    for name in ("r1", "r2"):
        assert shown.show(shown.keys[name], name) is None
    assert shown.gate.admit(*shown.said(signer="r2", under="r1")) == "forged"
    key, whole = shown.said()
    moved = key.replace("fire", "flood")
    assert shown.gate.admit(moved, whole) == "forged"
    assert shown.gate.turned == {("forged", "r1"): 2}


def test_a_certificate_counts_until_it_expires(shown: Shown) -> None:
    shown.show(shown.keys["r1"])
    shown.now_ns += round(DAYS * DAY.total_seconds() * NS_PER_S) - 2 * NS_PER_S
    assert shown.gate.admit(*shown.said()) is None
    shown.now_ns += 5 * NS_PER_S
    assert shown.gate.admit(*shown.said()) == "expired"
    assert shown.known.take_wanted() == [identity("r1")]
    assert shown.show(shown.keys.date("r1", end=now() + 2 * DAYS * DAY)) is None
    assert shown.gate.admit(*shown.said()) is None


def test_a_clock_that_begins_at_the_epoch_finds_all_valid(shown: Shown) -> None:
    shown.now_ns = 0
    assert shown.show(shown.keys["r1"]) is None
    assert shown.gate.admit(*shown.said()) is None


def test_certificates_of_no_use_are_counted_and_not_learnt(shown: Shown, tmp_path: Path) -> None:
    foreign = Keys(tmp_path / "others", ["r1"])["r1"]
    tries = [
        ("renamed", shown.keys["r2"].certificate.der),
        ("renamed", shown.keys["dap1"].certificate.der),
        ("foreign", foreign.certificate.der),
        ("expired", shown.keys.date("r1", end=now() - DAY).certificate.der),
        ("not_yet_valid", shown.keys.date("r1", now() + DAY, now() + 2 * DAY).certificate.der),
        ("unreadable", b"\x30"),
        ("unreadable", bytes(5000)),
    ]
    for why, der in tries:
        assert shown.known.learn(der, identity("r1")) == why
    assert shown.known.refused.total() == len(tries)
    assert shown.known.refused["renamed", "r1"] == 2
    assert shown.gate.admit(*shown.said()) == "unknown_signer"


def test_a_withdrawn_key_is_not_believed_and_its_successor_is(shown: Shown) -> None:
    lost = shown.keys["r1"]
    shown.show(lost)
    shown.keys.authority.issue([identity("r1")], (), now(), DAYS, replace=True)
    told = shown.keys["dap1"]
    known = KnownSigners(told.authority, lambda: shown.now_ns, told.nodes.withdrawn)
    gate = Gate(known)
    assert known.learn(lost.certificate.der) == "withdrawn"
    assert known.learn(shown.keys["r1"].certificate.der) is None
    assert gate.admit(*message(lost, KEY.format("r1"))) == "forged"
    assert gate.admit(*shown.said()) is None


def test_what_was_signed_before_a_renewal_is_believed_after_it(shown: Shown) -> None:
    said_before = shown.said()
    shown.keys.authority.renew(["r1"], now(), DAYS)
    shown.show(shown.keys["r1"])
    assert shown.gate.admit(*said_before) is None


def test_made_up_nodes_use_up_no_memory(shown: Shown) -> None:
    signer = shown.keys["r1"]
    for number in range(2 * MOST_WANTED):
        shown.gate.admit(*message(signer, KEY.format(f"x{number}")))
    assert len(shown.known.take_wanted()) == MOST_WANTED
    for number in range(MOST_TURNED + 10):
        shown.gate.admit(KEY.format(f"y{number}"), b"\x80")
    assert len(shown.gate.turned) <= MOST_TURNED + 1
    assert shown.gate.turned["unsealed", UNNAMED] > 0
