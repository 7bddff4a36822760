"""Bluetooth advertisements: who sends them, and an adapter that comes and goes."""

from __future__ import annotations

from contextlib import asynccontextmanager
from threading import Event, Thread
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any
from uuid import UUID

import pytest
from hypothesis import given
from hypothesis import strategies as st
from structlog.testing import capture_logs

from shared.clock import SystemClock
from shared.messages import StationTable
from shared.radios import ble
from shared.radios.ble import BleSource, Bluetooth, Heed, open_bluetooth
from shared.radios.ble_advertisements import APPLE, reading_of
from shared.radios.hearing import Hearing
from shared.radios.readings import RadioScan, Reading, ScannerError
from tests.waiting import DEADLINE_S, wait_for

if TYPE_CHECKING:
    from collections.abc import AsyncIterator
    from pathlib import Path

A = "c2:00:5e:10:00:01"
OWN = "f0000000-0000-4000-8000-00000000000a"
HEART_RATE = "0000180d-0000-1000-8000-00805f9b34fb"
BEACON = b"\x02\x15" + UUID(OWN).bytes + b"\x01\x02\x00\x07\xc5"


def test_a_sender_has_all_the_names_that_it_gives() -> None:
    reading = reading_of(A.upper(), -61, {APPLE: BEACON, 1: b"?"}, [HEART_RATE, OWN.upper()])
    assert reading == Reading(A, -61, aliases=(OWN, f"{OWN}/258/7"))


def test_a_sender_without_a_name_is_nobody() -> None:
    assert reading_of("?", -61, {}, [HEART_RATE]) is None


@given(st.binary(max_size=40))
def test_no_manufacturers_data_is_taken_amiss(data: bytes) -> None:
    reading = reading_of(A, -61, {APPLE: data}, [])
    assert reading is not None
    assert bool(reading.aliases) == (data[:2] == BEACON[:2] and len(data) == len(BEACON))


def test_the_table_may_list_any_of_the_names() -> None:
    table = StationTable(event_time_ns=0, sequence=0, responders=((f"{OWN}/258/7", "r1"),), daps=())
    hearing = Hearing("dap", "dap1", table)
    reading = Reading(A, -61.0, aliases=(OWN, f"{OWN}/258/7"))
    (heard,) = hearing.sort_out(RadioScan(5, (reading,)))
    assert heard == (5, "responder", "r1", -61.0)
    assert hearing.strangers == 0
    list(hearing.sort_out(RadioScan(6, (Reading(A, -61.0),))))
    assert hearing.strangers == 1


class Adapter:
    """An adapter that hears one sender, as often as it is told to."""

    def __init__(self) -> None:
        self.is_there = True
        self.heed: Heed | None = None

    @asynccontextmanager
    async def listen(self, heed: Heed) -> AsyncIterator[None]:
        """Listen until the block ends."""
        if not self.is_there:
            raise OSError("org.bluez.Error.NotReady")
        self.heed = heed
        yield
        self.heed = None

    def advertise(self, rssi_dbm: int) -> None:
        """Have the sender heard."""
        told = SimpleNamespace(rssi=rssi_dbm, manufacturer_data={}, service_uuids=[])
        heed = self.heed
        if heed is not None:
            heed(SimpleNamespace(address=A), told)

    @property
    def bluetooth(self) -> Bluetooth:
        """How to listen with it."""
        return Bluetooth(self.listen, (OSError,), lambda: self.is_there)


def test_advertisements_are_gathered_and_an_adapter_that_goes_is_waited_for() -> None:
    adapter, stop, scans = Adapter(), Event(), list[RadioScan]()
    source = BleSource("ble:hci0", adapter.bluetooth, rate_hz=500.0, try_again_s=0.002)
    thread = Thread(target=source.listen, args=(scans.append, SystemClock().now_ns, stop))

    def heard(rssi_dbm: int) -> bool:
        adapter.advertise(rssi_dbm)
        return any(reading.rssi_dbm == rssi_dbm for scan in scans for reading in scan.readings)

    with capture_logs() as logs:
        thread.start()
        wait_for(lambda: heard(-50), "an advertisement")
        adapter.is_there = False
        wait_for(lambda: logs, "the loss to be said")
        adapter.is_there = True
        wait_for(lambda: heard(-60), "an advertisement after it")
        stop.set()
        thread.join(DEADLINE_S)
    assert [entry["event"] for entry in logs] == [
        "the radio is gone: it is looked for", "the radio is back"
    ]  # fmt: skip
    readings = [reading for scan in scans for reading in scan.readings]
    assert {reading.address for reading in readings} == {A}
    assert min(reading.age_ns for reading in readings) >= 0
    times_ns = [scan.time_ns for scan in scans]
    assert times_ns == sorted(times_ns)


def test_an_adapter_that_is_not_there_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("bleak")
    monkeypatch.setattr(ble, "ADAPTERS", tmp_path)
    (tmp_path / "hci7").mkdir()
    with pytest.raises(ScannerError, match="no such adapter; there are: hci7"):
        open_bluetooth("hci0")
    bluetooth = open_bluetooth("hci7")
    assert bluetooth.is_there()
    scanner: Any = bluetooth.listen(lambda _device, _advertisement: None)
    assert hasattr(scanner, "__aenter__")


def test_without_bleak_it_is_said_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "bleak", None)
    with pytest.raises(ScannerError, match=r"install 'clew\[ble\]'"):
        open_bluetooth("hci0")
