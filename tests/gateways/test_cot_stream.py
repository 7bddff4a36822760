"""Anything may come from TAK: the link lives on, and nothing is done that it may not ask for."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from command_post.fusion.settings import FusionSettings
from command_post.gateways.cot import LONGEST_EVENT_BYTES, Heard
from command_post.gateways.cot_stream import MOST_MAYDAYS, EventStream, OutsideWords
from command_post.incident import Incident, IncidentSettings
from shared.codec import decode, encode, parse_key
from shared.geodesy import Origin
from shared.messages import OutsideWord
from shared.topics import Key
from tests.gateways.test_cot import event

ORIGIN = Origin(latitude_deg=37.5, longitude_deg=127.0)
SETTINGS = IncidentSettings(fusion=FusionSettings(particles=10))
KEY = str(Key(SETTINGS.incident, "post", "tak", "outside"))

BOMB = b'<?xml version="1.0"?><!DOCTYPE b [<!ENTITY a "b-a-o-tbl">%s]>' % b"".join(
    b'<!ENTITY a%d "%s">' % (level + 1, b"&a%d;" % level * 10) for level in range(1, 9)
)
OUTSIDE = b'<!DOCTYPE b [<!ENTITY a SYSTEM "file:///etc/hostname">]>'
DEEP = b"<a>" * 15_000
HOSTILE = [
    BOMB + event("b-m-p", "&a9;"), OUTSIDE + event("b-m-p", "&a;"), event("b-m-p")[:-8] + DEEP,
    event("b-m-p").replace(b"uid=", b" ".join(b"x%d='1'" % n for n in range(20_000)) + b" uid="),
    b"<event>" + b"A" * 3 * LONGEST_EVENT_BYTES, b"</event>" * 5_000,
    b'<?xml version="1.0" encoding="utf-7"?>' + event("b-m-p"),
    event("b-m-p").decode().encode("utf-16"),
]  # fmt: skip
KINDS = ["b-m-p-s-m", "b-t-f", "b-a-o-tbl", "b-a-o-can", "a-f-G-U-C", "t-x-c-t"]


@st.composite
def bent_events(draw: st.DrawFn) -> bytes:
    """Return a true event of which a stretch was cut out, or replaced by anything."""
    whole = event(draw(st.sampled_from(KINDS)), "<remarks>come</remarks>")
    start = draw(st.integers(0, len(whole)))
    end = draw(st.integers(start, min(start + 40, len(whole))))
    return whole[:start] + draw(st.binary(max_size=12) | st.just(b"")) + whole[end:]


pieces = st.lists(
    st.one_of(
        bent_events(), st.sampled_from(KINDS).map(event), st.binary(max_size=60),
        st.sampled_from([BOMB, OUTSIDE, b"<event><", b"-->", b"<![CDATA[", b"</event>"]),
        st.integers(1, 2 * LONGEST_EVENT_BYTES).map(lambda size: b" " * size),
    ),
    max_size=8,
)  # fmt: skip


def words_of(pieces: list[bytes]) -> Iterator[OutsideWord]:
    stream, words = EventStream(), OutsideWords(ORIGIN)
    for piece in pieces:
        for heard in stream.feed(piece):
            word = words.word(heard, 5)
            assert word is not None
            yield word


@given(pieces, st.integers(1, 99))
@settings(deadline=None, max_examples=60)
def test_nothing_but_a_mayday_or_its_end_does_anything(pieces: list[bytes], size: int) -> None:
    stream = b"".join(pieces)
    size = max(size, len(stream) // 1_000)
    cut = [stream[at : at + size] for at in range(0, len(stream), size)]
    said = list(words_of(cut))
    assert said == list(words_of([stream])), "however it was cut"
    incident = Incident(SETTINGS)
    for word in said:
        key, payload = parse_key(KEY), encode(word)
        assert isinstance(key, Key)
        assert decode(key, payload) == word, "as the post will read it"
        made = incident.handle(KEY, payload, 10)
        assert all(str(each.key).endswith("/alert") for each in made)
        assert not made or word.kind in ("mayday", "cancel")
    assert not incident.refusals
    assert not list(incident.orders.waited_for())
    assert b"b-a-" in stream or not incident.alerts


@pytest.mark.parametrize("data", HOSTILE, ids=range(len(HOSTILE)))
def test_what_is_meant_to_harm_is_passed_over(data: bytes) -> None:
    assert list(words_of([data])) == []
    (word,) = words_of([data, b"</event>", event("b-t-f", "<remarks>still here</remarks>")])
    assert word.words == "still here"


def test_so_many_maydays_stand_and_one_that_is_taken_back_makes_room() -> None:
    words = OutsideWords(ORIGIN)

    def says(kind: str, number: int) -> OutsideWord | None:
        return words.word(Heard(kind, f"u{number}", "A1", "", None), 5)  # type: ignore[arg-type]

    assert all(says("mayday", number) for number in range(MOST_MAYDAYS))
    assert says("mayday", 0), "one that stands may be said again"
    assert says("mayday", MOST_MAYDAYS) is None
    assert says("cancel", 3)
    assert says("mayday", MOST_MAYDAYS)
