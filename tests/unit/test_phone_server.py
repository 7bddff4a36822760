"""A phone that comes to the agent: its page, what it sends, and who is turned away."""

from __future__ import annotations

import urllib.error
import urllib.request
from collections.abc import Generator, Iterator
from itertools import islice

import msgspec
import pytest
from msgspec.structs import replace
from structlog.testing import capture_logs
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection, connect

from edge_agent.mayday_controls import Request
from edge_agent.sources.opening import open_source
from edge_agent.sources.phone_server import DISPLACED, PhoneServer
from edge_agent.sources.phone_stream import PhonePush
from edge_agent.sources.reading import Quiet, Reading, Source
from edge_agent.sources.recording import SourceError
from shared.messages import ImuSample
from tests.unit.test_phone_stream import BEGIN_NS, batches, walk

NOW_NS = 1_900_000_000_000_000_000


def ask(url: str, body: bytes | None = None) -> tuple[int, bytes]:
    try:
        with urllib.request.urlopen(urllib.request.Request(url, body), timeout=30) as answer:  # noqa: S310
            return answer.status, answer.read()
    except urllib.error.HTTPError as error:
        with error:
            return error.code, error.read()


@pytest.fixture
def server() -> PhoneServer:
    return PhoneServer("127.0.0.1:0", lambda: NOW_NS, None, "secret")


@pytest.fixture
def readings(server: PhoneServer) -> Iterator[Generator[Reading, None, None]]:
    found = Source(server.readings(), NOW_NS, None).beginning_at(NOW_NS)
    assert isinstance(next(found), Quiet)
    assert isinstance(found, Generator)
    yield found
    found.close()


def test_a_walk_is_pushed_and_dated_by_our_clock(
    server: PhoneServer, readings: Generator[Reading, None, None]
) -> None:
    samples = walk()
    for push in batches(samples, size=200):
        assert ask(f"{server.url}push", msgspec.json.encode(push)) == (200, b"")
    found: list[ImuSample] = []
    while len(found) < len(samples):
        reading = next(readings)
        if isinstance(reading, ImuSample):
            found.append(reading)
    # The first message's newest reading, of the gyroscope, is of now; then time goes on as it did.
    assert found[199].time_ns == NOW_NS - 4_000_000
    times_ns = [one.time_ns - BEGIN_NS for one in samples]
    assert [one.time_ns - found[0].time_ns for one in found[:200]] == times_ns[:200]


def test_a_message_sent_again_is_taken_once_and_a_torn_one_not_at_all(
    server: PhoneServer, readings: Generator[Reading, None, None]
) -> None:
    samples = walk()[:1000]
    for number, push in enumerate(batches(samples)):
        body = msgspec.json.encode(PhonePush(push.payload, "walk", number))
        assert ask(f"{server.url}push", body[:-1])[0] == 400
        assert ask(f"{server.url}push", body) == (200, b"")
        if number >= 10:
            # Older than a clock that was set back might tell.
            again = PhonePush(next(iter(batches(samples))).payload, "walk", 0)
            assert ask(f"{server.url}push", msgspec.json.encode(again)) == (200, b"")
    found = [one for one in islice(readings, len(samples)) if isinstance(one, ImuSample)]
    assert isinstance(next(readings), Quiet)
    assert [one.force_m_s2 for one in found] == [one.force_m_s2 for one in samples]


def test_a_message_there_is_no_room_for_is_taken_when_it_comes_again(
    server: PhoneServer,
    readings: Generator[Reading, None, None],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    samples = walk()[:800]
    first, second = (
        msgspec.json.encode(PhonePush(push.payload, "walk", number))
        for number, push in enumerate(batches(samples, size=400))
    )
    monkeypatch.setattr("edge_agent.sources.phone_server.MOST_WAITING", 10)
    assert ask(f"{server.url}push", first)[0] == 200
    assert ask(f"{server.url}push", second)[0] == 503
    found = list(islice(readings, 400))
    assert ask(f"{server.url}push", second)[0] == 200
    found += islice(readings, 400)
    forces = [one.force_m_s2 for one in found if isinstance(one, ImuSample)]
    assert forces == [one.force_m_s2 for one in samples]


def test_a_mayday_is_held_on_the_page_and_how_it_stands_is_told(
    server: PhoneServer, readings: Generator[Reading, None, None]
) -> None:
    assert b"MAYDAY" in ask(server.url)[1]
    assert ask(f"{server.url}mayday", b"call") == (200, b"")
    assert server.button.requests(stands=False) == [Request("call", "held on the phone")]
    server.button.tell("HEARD")
    assert ask(f"{server.url}mayday") == (200, b"HEARD")
    assert ask(f"{server.url}mayday", b"dance" * 1000)[0] == 400
    assert server.button.requests(stands=True) == []


def test_a_walk_is_streamed_and_each_message_answered(
    server: PhoneServer, readings: Generator[Reading, None, None]
) -> None:
    samples = walk()
    with stream(server) as phone:
        for push in batches(samples, size=200):
            phone.send(msgspec.json.encode(push).decode())
            assert phone.recv(timeout=30) == "taken"
    found = list(islice(readings, len(samples)))
    assert [isinstance(one, ImuSample) for one in found] == [True] * len(samples)


def test_a_stream_of_garbage_is_closed(
    server: PhoneServer, readings: Generator[Reading, None, None]
) -> None:
    for garbage in ("nonsense", b"\x00", "[]", ""):
        with stream(server) as phone:
            phone.send(garbage)
            with pytest.raises(ConnectionClosed) as closed:
                phone.recv(timeout=30)
        assert closed.value.rcvd is not None
        assert closed.value.rcvd.code == 1007
    with stream(server) as phone:
        phone.send(" " * 4_100_000)
        with pytest.raises(ConnectionClosed):
            phone.recv(timeout=30)
    assert isinstance(next(readings), Quiet)


def test_of_two_phones_the_one_that_came_last_is_followed_and_the_other_told(
    server: PhoneServer, readings: Generator[Reading, None, None]
) -> None:
    bodies = [
        msgspec.json.encode(PhonePush(push.payload, session, number)).decode()
        for number, push in enumerate(islice(batches(walk()), 3))
        for session in ("one", "other")
    ]
    with stream(server) as one, stream(server) as other:
        for phone, body in zip((one, other), bodies, strict=False):
            phone.send(body)
            assert phone.recv(timeout=30) == "taken"
        one.send(bodies[2])
        with pytest.raises(ConnectionClosed, match="another phone"):
            one.recv(timeout=30)
        other.send(bodies[3])
        assert other.recv(timeout=30) == "taken"
    assert ask(f"{server.url}push", bodies[4].encode()) == (400, DISPLACED.encode())


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_an_iphone_that_tells_forces_downwards_is_told_of(
    server: PhoneServer, readings: Generator[Reading, None, None], sign: float
) -> None:
    held = [replace(one, force_m_s2=(0.0, 6.0 * sign, 7.0 * sign)) for one in walk()[:50]]
    with capture_logs() as logs:
        for push in batches(held):
            assert ask(f"{server.url}push", msgspec.json.encode(push)) == (200, b"")
    assert any("upside down" in one["event"] for one in logs) == (sign < 0.0)


def stream(server: PhoneServer) -> ClientConnection:
    return connect(server.url.replace("http", "ws") + "stream")


def test_the_page_is_given_to_who_knows_its_address(
    server: PhoneServer, readings: Generator[Reading, None, None]
) -> None:
    code, page = ask(server.url)
    assert code == 200
    assert b"devicemotion" in page
    code, words = ask(server.url.replace("secret", "guess"))
    assert (code, words[:14]) == (404, b"nobody listens")
    assert ask(server.url.replace("secret", "guess") + "push", b"{}")[0] == 404


def test_garbage_and_too_much_are_refused(
    server: PhoneServer, readings: Generator[Reading, None, None]
) -> None:
    assert ask(f"{server.url}push", b"{}")[0] == 400
    assert ask(f"{server.url}push", b" " * 4_100_000)[0] == 413
    assert isinstance(next(readings), Quiet)


@pytest.mark.parametrize("where", ["nowhere", "127.0.0.1:port", "127.0.0.1:99999"])
def test_where_nobody_can_listen_is_told(where: str) -> None:
    with pytest.raises(SourceError, match="phone-live:"):
        open_source(f"phone-live:{where}", "r1", 0, "chest")
