"""Access points as wpa_supplicant tells of them, over its control socket."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from shared.radios.readings import ScannerError
from shared.radios.station_counters import Polled
from shared.radios.wpa import WpaRadio
from shared.radios.wpa_results import linked_to, scanned
from tests.fake_hostapd import FakeWpa

A, B = "02:00:5e:10:00:81", "02:00:5e:10:00:82"


@given(st.text(max_size=60), st.text(max_size=60))
def test_whatever_is_answered_is_taken_as_far_as_it_goes(one: str, other: str) -> None:
    assert linked_to(one, other) is None
    assert list(scanned(one)) == []


def test_who_is_linked_is_heard_at_every_poll_and_others_when_a_scan_found_them(
    tmp_path: Path,
) -> None:
    with FakeWpa(tmp_path / "wlan0") as wpa:
        radio = WpaRadio(tmp_path / "wlan0")
        assert list(radio.poll()) == []
        wpa.link, wpa.found = (A, -52), {A: -55, B: -70}
        assert list(radio.poll()) == [Polled(A, (2,), -52.0)]
        wpa.say("CTRL-EVENT-SCAN-RESULTS ")
        assert list(radio.poll()) == [Polled(A, (3,), -52.0), Polled(B, (3,), -70.0)]
        assert list(radio.poll()) == [Polled(A, (4,), -52.0)]
        wpa.say("CTRL-EVENT-TERMINATING ")
        with pytest.raises(OSError, match="TERMINATING"):
            list(radio.poll())
        radio.close()


def test_where_there_is_none_it_is_said_what_to_do(tmp_path: Path) -> None:
    with pytest.raises(ScannerError, match="ctrl_interface=/run/wpa_supplicant"):
        WpaRadio(tmp_path / "wlan0")
