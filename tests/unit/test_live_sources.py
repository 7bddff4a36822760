"""Radios as they are heard: steadily, gone, back, several at once."""

from __future__ import annotations

import errno
from collections.abc import Callable, Iterable, Iterator
from itertools import islice
from pathlib import Path
from threading import Event, Thread
from typing import Any

import pytest
from structlog.testing import capture_logs

from dap_node.scanners.live import live_observations
from dap_node.scanners.opening import PLAYED, open_played
from shared.clock import ManualClock, SystemClock
from shared.radios.live import LiveSource, PolledSource
from shared.radios.nl80211 import Netlink, Nl80211Radio
from shared.radios.opening import open_radios
from shared.radios.readings import RadioScan, Reading, ScannerError
from shared.radios.station_counters import Polled
from tests.netlink_answers import station
from tests.waiting import DEADLINE_S, wait_for

A = "02:00:5e:10:00:01"


class Adapter:
    """A radio that can be unplugged. Its one station sends a packet between polls."""

    def __init__(self) -> None:
        self.plugged_in = True
        self.polls = 0
        self.opened = 0

    def open(self) -> Adapter:
        """Open it."""
        if not self.plugged_in:
            raise ScannerError("no such interface")
        self.opened += 1
        return self

    def poll(self) -> Iterable[Polled]:
        """Tell of the station."""
        if not self.plugged_in:
            raise OSError(errno.ENODEV, "No such device")
        self.polls += 1
        return [Polled(A, (self.polls,), -50.0)]

    def close(self) -> None:
        """Do nothing."""


def test_a_radio_that_is_not_there_is_told_at_once() -> None:
    adapter = Adapter()
    adapter.plugged_in = False
    with pytest.raises(ScannerError, match="no such interface"):
        PolledSource("usb", adapter.open)


def test_a_radio_that_is_pulled_out_and_plugged_in_again_is_gone_on_with() -> None:
    adapter, stop = Adapter(), Event()
    source = PolledSource("usb", adapter.open, rate_hz=1000.0, try_again_s=0.001)
    scans: list[RadioScan] = []
    clock = SystemClock()
    thread = Thread(target=source.listen, args=(scans.append, clock.now_ns, stop))
    with capture_logs() as logs:
        thread.start()
        wait_for(lambda: len(scans) > 3, "scans")
        adapter.plugged_in = False
        wait_for(lambda: any("gone" in entry["event"] for entry in logs), "the loss to be said")
        before = len(scans)
        adapter.plugged_in = True
        wait_for(lambda: len(scans) > before + 3, "scans again")
        stop.set()
        thread.join(DEADLINE_S)
    assert [entry["event"] for entry in logs] == [
        "the radio is gone: it is looked for", "the radio is back"
    ]  # fmt: skip
    assert adapter.opened == 2
    heard = [scan.readings for scan in scans]
    # What it counts may begin anew with it.
    assert heard[0] == heard[before] == ()
    assert set(heard[1:before]) == set(heard[before + 1 :]) == {(Reading(A, -50.0),)}


class Script:
    """A source that has all its scans beforehand, or a fault."""

    name = "script"

    def __init__(self, *scans: RadioScan, fault: Exception | None = None) -> None:
        self.scans = scans
        self.fault = fault

    is_away = False

    def listen(self, deliver: Callable[[RadioScan], None], *_: object) -> None:
        """Deliver all of it."""
        for scan in self.scans:
            deliver(scan)
        if self.fault is not None:
            raise self.fault


def observations(*sources: LiveSource[RadioScan]) -> Iterator[Any]:
    return live_observations(sources, ManualClock(3), Event())


def test_several_radios_are_heard_together_and_time_does_not_go_back() -> None:
    one = Script(RadioScan(5, (Reading(A, -50.0),)), RadioScan(9, ()))
    other = Script(RadioScan(7, (Reading(A, -60.0),)))
    found = list(islice(observations(one, other), 3))
    assert sorted(len(scan.readings) for scan in found) == [0, 1, 1]
    times_ns = [scan.time_ns for scan in found]
    assert times_ns == sorted(times_ns)


def test_while_nothing_is_heard_time_goes_on() -> None:
    assert next(observations(Script())) == RadioScan(3, ())


def test_a_source_with_a_fault_ends_it_all() -> None:
    with pytest.raises(RuntimeError, match="a fault"):
        list(observations(Script(fault=RuntimeError("a fault"))))


class Kernel:
    """The kernel's Wi-Fi: each answer is raw messages, or what it refuses with."""

    def __init__(self, *answers: list[bytes] | Exception) -> None:
        self.answers = list(answers)

    def get_stations(self, *_: object, **__: object) -> Iterator[Any]:
        """Give the next answer."""
        nl80211 = pytest.importorskip("pyroute2.netlink.nl80211")
        answer = self.answers.pop(0)
        if isinstance(answer, Exception):
            raise answer
        for raw in answer:
            message = nl80211.nl80211cmd(raw)
            message.decode()
            yield message

    def close(self) -> None:
        """Do nothing."""


class RefusedError(Exception):
    """A netlink refusal."""

    def __init__(self, code: int) -> None:
        super().__init__(code)
        self.code = code


class InterruptedDumpError(RefusedError):
    """A dump that was broken off."""


def radio(*answers: list[bytes] | Exception) -> Nl80211Radio:
    return Nl80211Radio(
        "lo", lambda: Netlink(Kernel(*answers), (RefusedError,), InterruptedDumpError)
    )


def test_an_interface_is_asked_for_its_stations() -> None:
    raw = station(A, packets=4, signal_dbm=-44)
    assert radio([raw]).poll() == [Polled(A, (4, 400), -44.0)]
    assert radio(InterruptedDumpError(-1), [raw]).poll() == [Polled(A, (4, 400), -44.0)]
    with pytest.raises(InterruptedError):
        radio(*[InterruptedDumpError(-1)] * 3).poll()


@pytest.mark.parametrize(
    ("code", "words"),
    [(errno.EPERM, "CAP_NET_ADMIN"), (errno.EOPNOTSUPP, "another adapter"), (errno.ENODEV, "19")],
)
def test_what_the_kernel_refuses_is_told_in_words(code: int, words: str) -> None:
    with pytest.raises(OSError, match=words) as raised:
        radio(RefusedError(code)).poll()
    assert raised.value.errno == code


@pytest.mark.parametrize(
    ("name", "complaint"),
    [
        ("nl80211:nosuch0", "no such interface; of Wi-Fi there are: "),
        ("hostapd:/nowhere/wlan0", "no hostapd answers"),
        ("wlan0", "write nl80211:INTERFACE"),
        ("nl80211:", "write nl80211:INTERFACE"),
        ("simulated:course", "give no other beside it"),
    ],
)
def test_sources_that_cannot_be_opened_are_told(name: str, complaint: str) -> None:
    with pytest.raises(ScannerError, match=complaint):
        open_radios([name, name], "--source", PLAYED)


def test_a_dump_that_is_not_there_is_told(tmp_path: Path) -> None:
    with pytest.raises(ScannerError, match="cannot be read"):
        open_played(f"recorded:{tmp_path}/none.jsonl", "dap1", 1)
    assert open_played("nl80211:wlan0", "dap1", 1) is None
