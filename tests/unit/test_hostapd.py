"""Stations as hostapd tells of them, over its control socket."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from shared import wpa_control
from shared.radios.hostapd import HostapdRadio
from shared.radios.hostapd_stations import polled_station
from shared.radios.readings import ScannerError
from shared.radios.station_counters import Polled
from shared.wpa_control import ControlSocket
from tests.fake_hostapd import FakeHostapd
from tests.waiting import wait_for

A, B = "02:00:5e:10:00:01", "02:00:5e:10:00:02"


def heard(packets: int, signal: int = -50) -> dict[str, int]:
    return {"rx_packets": packets, "rx_bytes": 10, "inactive_msec": 12, "signal": signal}


@pytest.fixture
def hostapd(tmp_path: Path) -> Iterator[FakeHostapd]:
    with FakeHostapd(tmp_path / "wlan0") as fake:
        yield fake


@pytest.fixture
def radio(hostapd: FakeHostapd, tmp_path: Path) -> Iterator[HostapdRadio]:
    radio = HostapdRadio(tmp_path / "wlan0")
    yield radio
    radio.close()


@pytest.mark.parametrize("answer", ["", "FAIL", "UNKNOWN COMMAND", "02:00:5e:10:00"])
def test_an_answer_that_names_no_station_is_none(answer: str) -> None:
    assert polled_station(answer) is None


def test_an_answer_is_taken_as_far_as_it_goes() -> None:
    assert polled_station(f"{A}\nflags=[AUTH]\nsignal=?\nrx_packets=7") == Polled(A, (7,))


def test_all_stations_are_asked_for(hostapd: FakeHostapd, radio: HostapdRadio) -> None:
    assert list(radio.poll()) == []
    hostapd.stations = {A: heard(5), B: heard(6, signal=-71)}
    assert list(radio.poll()) == [
        Polled(A, (5, 10), -50.0, inactive_ms=12),
        Polled(B, (6, 10), -71.0, inactive_ms=12),
    ]
    assert hostapd.asked[-3:] == ["STA-FIRST", f"STA-NEXT {A}", f"STA-NEXT {B}"]


def test_events_between_command_and_answer_are_told_apart(
    hostapd: FakeHostapd, radio: HostapdRadio
) -> None:
    hostapd.stations = {A: heard(5)}
    for _ in range(3):
        hostapd.say(f"AP-STA-CONNECTED {A}")
        hostapd.say(f"AP-STA-DISCONNECTED {A}")
        assert [station.address for station in radio.poll()] == [A]


def test_an_access_point_that_ends_is_gone(hostapd: FakeHostapd, radio: HostapdRadio) -> None:
    hostapd.say("CTRL-EVENT-TERMINATING ")
    with pytest.raises(OSError, match="CTRL-EVENT-TERMINATING"):
        list(radio.poll())


def test_one_that_does_not_answer_is_gone(
    hostapd: FakeHostapd, radio: HostapdRadio, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(wpa_control, "ANSWER_S", 0.05)
    hostapd.deaf = True
    with pytest.raises(TimeoutError, match="STA-FIRST is not answered"):
        list(radio.poll())


def test_where_there_is_none_it_is_said_what_to_do(tmp_path: Path) -> None:
    with pytest.raises(ScannerError, match="ctrl_interface=/run/hostapd"):
        HostapdRadio(tmp_path / "wlan0")


@pytest.fixture
def real_socket(tmp_path: Path) -> Iterator[Path]:
    """Path of the control socket of a real hostapd, which has no radio."""
    program = shutil.which("hostapd", path="/usr/sbin:/usr/local/sbin:/usr/bin:/usr/local/bin")
    if program is None:
        pytest.skip("no hostapd on this machine")
    file = tmp_path / "hostapd.conf"
    file.write_text(f"interface=clew0\ndriver=none\nctrl_interface={tmp_path}/control\nssid=clew\n")
    with subprocess.Popen([program, str(file)], stdout=subprocess.PIPE) as process:
        path = tmp_path / "control" / "clew0"
        wait_for(path.exists, "hostapd")
        yield path
        process.terminate()


def test_a_real_hostapd_is_understood(real_socket: Path) -> None:
    radio = HostapdRadio(real_socket)
    assert list(radio.poll()) == []
    commander = ControlSocket(real_socket)
    for address in (A, B):
        assert commander.request(f"NEW_STA {address}") == "OK"
    # Without a radio behind it hostapd counts nothing, and has no signal.
    assert sorted(radio.poll()) == [Polled(A, ()), Polled(B, ())]
    assert commander.request(f"DISASSOCIATE {A}") == "OK"
    assert commander.take_events() == [
        f"AP-STA-CONNECTED {A}", f"AP-STA-CONNECTED {B}", f"AP-STA-DISCONNECTED {A}"
    ]  # fmt: skip
    assert commander.request("DISABLE") == "OK"
    with pytest.raises(OSError, match="AP-DISABLED"):
        list(radio.poll())
    for each in (radio, commander):
        each.close()
