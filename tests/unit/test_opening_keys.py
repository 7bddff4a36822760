"""A program has its own keys, or is told to do without; it says so, and says what to do."""

from __future__ import annotations

from datetime import timedelta
from pathlib import Path

import pytest
from structlog.testing import capture_logs

from shared.security.bundle import BundleError
from shared.security.opening import local_endpoint, open_keys
from tests.issued_keys import Keys, identity, now
from tests.waiting import wait_for

R1 = identity("r1")


def test_without_keys_it_says_that_nothing_is_protected() -> None:
    with capture_logs() as logs:
        assert open_keys(None, R1, insecure=True) is None
    assert "nothing is encrypted or authenticated" in logs[0]["event"]
    assert local_endpoint(None) == "tcp/127.0.0.1:7447"


def test_it_is_one_or_the_other(tmp_path: Path) -> None:
    with pytest.raises(BundleError, match="give --keys FOLDER"):
        open_keys(None, R1, insecure=False)
    with pytest.raises(BundleError, match="one of them"):
        open_keys(tmp_path, R1, insecure=True)


def test_keys_are_their_own_nodes(tmp_path: Path) -> None:
    keys = Keys(tmp_path / "keys", ["r1", "post"])
    with capture_logs() as logs:
        bundle = open_keys(keys["r1"].folder, R1, insecure=False)
    assert bundle is not None
    assert (bundle.identity, logs) == (R1, [])
    assert local_endpoint(bundle, 0) == "tls/127.0.0.1:0"
    for other in ("r2", "post"):
        with pytest.raises(BundleError, match="keys of responder 'r1'"):
            open_keys(keys["r1"].folder, identity(other), insecure=False)


@pytest.mark.parametrize(
    ("begin_h", "end_h", "level", "words"),
    [
        (-9, -1, "error", "has expired"),
        (1, 9, "error", "not valid yet"),
        (-9, 9, "warning", "expires soon"),
    ],
)
def test_it_says_when_a_certificate_is_of_no_use_for_long(
    tmp_path: Path, begin_h: int, end_h: int, level: str, words: str
) -> None:
    keys = Keys(tmp_path / "keys", ["r1"])
    bundle = keys.date("r1", now() + timedelta(hours=begin_h), now() + timedelta(hours=end_h))
    with capture_logs() as logs:
        assert open_keys(bundle.folder, R1, insecure=False) is not None
    assert [each["log_level"] for each in logs] == [level]
    assert words in logs[0]["event"]


def test_it_says_so_when_a_certificate_expires_while_it_is_used(tmp_path: Path) -> None:
    keys = Keys(tmp_path / "keys", ["r1"])
    bundle = keys.date("r1", now() - timedelta(hours=1), now() + timedelta(seconds=2))
    with capture_logs() as logs:
        open_keys(bundle.folder, R1, insecure=False)
        wait_for(lambda: "has expired" in logs[-1]["event"], "the certificate to expire")
