"""A sealed message is still the message, and its seal tells run, number and whose word it is."""

from __future__ import annotations

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shared.codec import decode, encode
from shared.seal import RUN_BYTES, SIGNATURE_BYTES, read_seal, sealed, signed, to_be_signed
from shared.topics import TOPICS
from tests.wire_messages import key_for, messages

runs = st.binary(min_size=RUN_BYTES, max_size=RUN_BYTES)
numbers = st.integers(0, 2**64 - 1)


@pytest.mark.parametrize("topic", TOPICS)
@settings(max_examples=20)
@given(data=st.data(), run=runs, number=numbers)
def test_sealing_changes_nothing_of_the_message(
    topic: str, data: st.DataObject, run: bytes, number: int
) -> None:
    message = data.draw(messages(TOPICS[topic].message))
    key = key_for(topic)
    whole = signed(sealed(encode(message), run, number), str(key), lambda _: bytes(SIGNATURE_BYTES))
    assert decode(key, whole) == message
    entries = msgspec.msgpack.decode(whole)
    assert [name for name in entries if name.startswith("_")] == list(entries)[-3:]
    assert list(entries)[-3:] == ["_run", "_number", "_signature"]
    seal = read_seal(whole)
    assert seal is not None
    assert (seal.run, seal.number, seal.signature) == (run, number, bytes(SIGNATURE_BYTES))


@given(st.dictionaries(st.text(max_size=3), st.booleans(), max_size=40), runs, numbers)
def test_unsigned_seal_is_read_back(entries: dict[str, bool], run: bytes, number: int) -> None:
    payload = msgspec.msgpack.encode(entries)
    whole = sealed(payload, run, number)
    seal = read_seal(whole)
    assert seal is not None
    assert (seal.run, seal.number, seal.signature) == (run, number, None)
    assert msgspec.msgpack.decode(whole) == {**entries, "_run": run, "_number": number}


def test_the_signature_is_over_the_key_and_all_before_it() -> None:
    said: list[bytes] = []

    def sign(data: bytes) -> bytes:
        said.append(data)
        return bytes(range(SIGNATURE_BYTES))

    whole = signed(sealed(b"\x80", b"RUNRUNRU", 7), "clew/a", sign)
    seal = read_seal(whole)
    assert seal is not None
    assert said == [to_be_signed("clew/a", seal.signed)]
    assert whole == seal.signed + b"\xaa_signature\xc4\x40" + bytes(range(SIGNATURE_BYTES))


@given(st.binary(max_size=300))
def test_arbitrary_bytes_never_raise(payload: bytes) -> None:
    seal = read_seal(payload)
    assert seal is None or len(seal.run) == RUN_BYTES


@pytest.mark.parametrize("payload", [b"", b"\x93\x01\x02\x03", b"\xde\x00", b"text"])
def test_what_is_no_map_cannot_be_sealed(payload: bytes) -> None:
    with pytest.raises(ValueError, match="map"):
        sealed(payload, bytes(RUN_BYTES), 1)
