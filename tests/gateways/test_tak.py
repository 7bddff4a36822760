"""The post and a real TAK server: what one says the other's clients hear, and the other way."""

from __future__ import annotations

import shutil
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from command_post.gateways.tak import TakServer, checked_server, linked_to_tak
from shared.bus.loopback import free_ports
from shared.codec import decode, parse_key
from shared.geodesy import Origin
from shared.messages import OutsideWord
from shared.topics import Key
from tests.gateways.test_cot import alert, event, track
from tests.waiting import wait_for

TAKY = shutil.which("taky", path=str(Path(sys.executable).parent))
pytestmark = pytest.mark.skipif(TAKY is None, reason="no taky in this environment")

ORIGIN = Origin(latitude_deg=37.5, longitude_deg=127.0)


@pytest.fixture
def server(tmp_path: Path) -> Iterator[tuple[str, int]]:
    (port,) = free_ports(1)
    (tmp_path / "taky.conf").write_text(
        "[taky]\nhostname=test\nbind_ip=127.0.0.1\nroot_dir=.\n"
        f"[cot_server]\nport={port}\n[dp_server]\nupload_path=./dp\n[ssl]\nenabled=false\n"
    )
    assert TAKY is not None
    with subprocess.Popen(
        [TAKY, "-c", str(tmp_path / "taky.conf")],
        cwd=tmp_path, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    ) as taky:  # fmt: skip
        try:
            wait_for(lambda: _answers(port), "taky")
            yield f"tcp://127.0.0.1:{port}", port
        finally:
            taky.terminate()


def _answers(port: int) -> bool:
    try:
        socket.create_connection(("127.0.0.1", port), 0.2).close()
    except OSError:
        return False
    return True


class Client:
    """Another client of the server: what it hears, and what it says."""

    def __init__(self, port: int) -> None:
        self._socket = socket.create_connection(("127.0.0.1", port))
        self.heard = b""
        self.say(event("a-f-G-U-C", '<contact callsign="E5"/>'))
        self._thread = threading.Thread(target=self._hear)
        self._thread.start()

    def say(self, data: bytes) -> None:
        """Send an event to the server."""
        self._socket.sendall(data)

    def close(self) -> None:
        """Leave the server."""
        self._socket.shutdown(socket.SHUT_RDWR)
        self._thread.join()
        self._socket.close()

    def _hear(self) -> None:
        while data := self._socket.recv(65_536):
            self.heard += data


def test_what_the_post_knows_reaches_another_client_and_what_that_says_the_post(
    server: tuple[str, int],
) -> None:
    url, port = server
    client = Client(port)
    try:
        with linked_to_tak(TakServer(url), "fire", ORIGIN) as link:
            assert link is not None
            link.published("clew/v1/fire/post/post/track", track(1.0))
            link.published("clew/v1/fire/post/post/alert", alert("raised"))
            wait_for(lambda: b'uid="clew-fire-r1"' in client.heard, "the responder")
            wait_for(lambda: b"b-a-o-tbl" in client.heard, "the alarm")
            link.published("clew/v1/fire/post/post/alert", alert("resolved"))
            wait_for(lambda: b"b-a-o-can" in client.heard, "its end")
            client.say(event("b-m-p-s-m", '<contact callsign="E5"/><remarks>hydrant</remarks>'))
            said: list[tuple[str, bytes]] = []

            def says() -> bool:
                said.extend(link.take_requests())
                return bool(said)

            wait_for(says, "the marker")
    finally:
        client.close()
    key = parse_key(said[0][0])
    assert isinstance(key, Key)
    assert (key.role, key.node_id) == ("post", "tak")
    word = decode(key, said[0][1])
    assert isinstance(word, OutsideWord)
    assert (word.kind, word.callsign, word.words) == ("marker", "E5", "hydrant")
    assert word.position is not None
    assert abs(word.position.north_m) < 0.01


def test_the_server_may_come_later_and_the_post_stops_meanwhile() -> None:
    (port,) = free_ports(1)
    with linked_to_tak(TakServer(f"tcp://127.0.0.1:{port}"), "fire", ORIGIN) as link:
        assert link is not None
        link.published("clew/v1/fire/post/post/track", track(1.0))
    assert threading.active_count() < 10


@pytest.mark.parametrize("url", ["udp://1.2.3.4:5", "tcp://host", "host:5", "tls://host:8089"])
def test_what_cannot_be_dialled_is_refused(url: str) -> None:
    with pytest.raises(ValueError, match="--tak"):
        checked_server(TakServer(url))
