"""The post and a real TAK server: what one says the other's clients hear, and the other way."""

from __future__ import annotations

import shutil
import socket
import ssl
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from cryptography.hazmat.primitives.serialization import (
    BestAvailableEncryption,
    Encoding,
    PrivateFormat,
    load_pem_private_key,
)
from structlog.testing import capture_logs

from command_post.gateways.tak import TakServer, checked_server, linked_to_tak
from shared.bus.loopback import free_ports
from shared.codec import decode, parse_key
from shared.geodesy import Origin
from shared.messages import OutsideWord
from shared.security.bundle import AUTHORITY_FILE, CERTIFICATE_FILE, KEY_FILE, Bundle
from shared.topics import Key
from tests.gateways.test_cot import alert, event, track
from tests.issued_keys import Keys, identity, now
from tests.waiting import wait_for

TAKY = shutil.which("taky", path=str(Path(sys.executable).parent))
pytestmark = pytest.mark.skipif(TAKY is None, reason="no taky in this environment")

ORIGIN = Origin(latitude_deg=37.5, longitude_deg=127.0)


@contextmanager
def serving(folder: Path, ssl_section: str) -> Iterator[int]:
    """Run a TAK server; give its port."""
    (port,) = free_ports(1)
    (folder / "taky.conf").write_text(
        "[taky]\nhostname=test\nbind_ip=127.0.0.1\nroot_dir=.\n"
        f"[cot_server]\nport={port}\n[dp_server]\nupload_path=./dp\n[ssl]\n{ssl_section}\n"
    )
    assert TAKY is not None
    with subprocess.Popen(
        [TAKY, "-c", str(folder / "taky.conf")],
        cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    ) as taky:  # fmt: skip
        try:
            wait_for(lambda: _answers(port), "taky")
            yield port
        finally:
            taky.terminate()


@pytest.fixture
def server(tmp_path: Path) -> Iterator[tuple[str, int]]:
    with serving(tmp_path, "enabled=false") as port:
        yield f"tcp://127.0.0.1:{port}", port


@pytest.fixture(scope="module")
def keys(tmp_path_factory: pytest.TempPathFactory) -> Keys:
    keys = Keys(tmp_path_factory.mktemp("keys"), ("post", "r1"))
    keys.authority.issue([identity("dap1")], ["127.0.0.1"], now(), 1.0)
    return keys


@pytest.fixture
def secure_server(tmp_path: Path, keys: Keys) -> Iterator[int]:
    own = keys["dap1"].folder
    section = (
        f"enabled=true\nclient_cert_required=true\nca={own / AUTHORITY_FILE}\n"
        f"cert={own / CERTIFICATE_FILE}\nkey={own / KEY_FILE}"
    )
    with serving(tmp_path, section) as port:
        yield port


def _answers(port: int) -> bool:
    try:
        socket.create_connection(("127.0.0.1", port), 0.2).close()
    except OSError:
        return False
    return True


class Client:
    """Another client of the server: what it hears, and what it says."""

    def __init__(self, port: int, bundle: Bundle | None = None) -> None:
        self._socket = socket.create_connection(("127.0.0.1", port))
        if bundle is not None:
            context = ssl.create_default_context(cafile=bundle.folder / AUTHORITY_FILE)
            context.load_cert_chain(bundle.folder / CERTIFICATE_FILE, bundle.folder / KEY_FILE)
            self._socket = context.wrap_socket(self._socket, server_hostname="127.0.0.1")
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


def post_dials(port: int, bundle: Bundle) -> TakServer:
    own = bundle.folder
    return TakServer(
        f"tls://127.0.0.1:{port}", own / CERTIFICATE_FILE, own / KEY_FILE, own / AUTHORITY_FILE
    )


# PyTAK sets options of TLS that Python has other words for.
of_pytak = pytest.mark.filterwarnings("ignore:ssl.OP_NO:DeprecationWarning")


@of_pytak
def test_over_mutual_tls_both_know_who_the_other_is(secure_server: int, keys: Keys) -> None:
    client = Client(secure_server, keys["r1"])
    try:
        dialled = checked_server(post_dials(secure_server, keys["post"]))
        with linked_to_tak(dialled, "fire", ORIGIN) as link:
            assert link is not None
            link.published("clew/v1/fire/post/post/track", track(1.0))
            wait_for(lambda: b'uid="clew-fire-r1"' in client.heard, "the responder")
            client.say(event("b-a-o-tbl", '<contact callsign="E5"/>'))
            said: list[tuple[str, bytes]] = []

            def says() -> bool:
                said.extend(link.take_requests())
                return bool(said)

            wait_for(says, "the mayday")
    finally:
        client.close()


@of_pytak
def test_nobody_is_told_who_shows_another_authoritys_certificate(
    secure_server: int, keys: Keys, tmp_path: Path
) -> None:
    """Neither does the post talk to such a server, nor the server to such a post."""
    (tmp_path / "others").mkdir()
    others = Keys(tmp_path / "others", ("post",))
    believes_ours = post_dials(secure_server, others["post"])._replace(
        authority=keys["post"].folder / AUTHORITY_FILE
    )
    for server in (post_dials(secure_server, others["post"]), believes_ours):
        client = Client(secure_server, keys["r1"])
        with capture_logs() as logs, linked_to_tak(server, "fire", ORIGIN) as link:
            assert link is not None
            link.published("clew/v1/fire/post/post/track", track(1.0))
            wait_for(lambda: any("no link to TAK" in each["event"] for each in logs), "a refusal")
        client.close()
        assert b"clew-fire" not in client.heard


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


def test_files_that_do_not_belong_together_are_refused(keys: Keys, tmp_path: Path) -> None:
    good = post_dials(8089, keys["post"])
    assert checked_server(good) == good
    with pytest.raises(ValueError, match="its own key, PEM"):
        checked_server(good._replace(key=keys["r1"].folder / KEY_FILE))
    (tmp_path / "ca.pem").write_text("nothing")
    with pytest.raises(ValueError, match="--tak-ca"):
        checked_server(good._replace(authority=tmp_path / "ca.pem"))
    key = load_pem_private_key((keys["post"].folder / KEY_FILE).read_bytes(), None)
    locked = key.private_bytes(
        Encoding.PEM, PrivateFormat.PKCS8, BestAvailableEncryption(b"secret")
    )
    (tmp_path / "locked.key").write_bytes(locked)
    with pytest.raises(ValueError, match="without a password"):
        checked_server(good._replace(key=tmp_path / "locked.key"))
