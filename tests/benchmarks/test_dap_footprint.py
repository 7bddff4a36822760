"""What a DAP takes of a small machine: its memory, and its share of a core."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from dap_node.commands.serve import LEAN
from shared.bus.interface import Received
from shared.bus.zenoh_bus import open_zenoh
from shared.process import ExitCode
from shared.radios.nl80211_stations import polled_station
from shared.radios.station_counters import StationCounters
from tests.fake_hostapd import FakeHostapd
from tests.issued_keys import Keys
from tests.netlink_answers import station
from tests.waiting import wait_for

STATIONS = 20
SCANS = 12
RATE_HZ = 5.0
MOST_RESIDENT_MB = 60.0
ADDRESSES = [f"02:00:5e:10:00:{number:02x}" for number in range(STATIONS)]

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="told by /proc")


def resident_mb(process_id: int) -> float:
    """Return the memory that a process has in use, in MB of 10^6 bytes, files included."""
    status = Path(f"/proc/{process_id}/status").read_text()
    (kilobytes,) = (line.split()[1] for line in status.splitlines() if line.startswith("VmRSS"))
    return int(kilobytes) * 1024 / 1e6


def worked_s(process_id: int) -> float:
    """Return the seconds that all threads of a process were at work, of one core."""
    tasks = Path(f"/proc/{process_id}/task").glob("*/schedstat")
    return sum(int(task.read_text().split()[0]) for task in tasks) / 1e9


def command_line(folder: Path, keys: Path, post: str) -> list[str]:
    """Return what runs a DAP that hears by hostapd."""
    return [
        sys.executable, "-m", "dap_node", "run", "--id", "dap2", "--incident", "fire",
        "--keys", str(keys), "--source", f"hostapd:{folder}/wlan0",
        "--stations", str(folder / "stations.csv"), "--journal", str(folder / "journal"),
        "--listen", "tls/127.0.0.1:0", "--connect", post,
    ]  # fmt: skip


def with_bluetooth(folder: Path, command: list[str]) -> list[str]:
    """Return what runs the same with an adapter besides: all that takes is loaded and tried."""
    (folder / "adapters" / "hci0").mkdir(parents=True)
    program = f"""
import os, pathlib, sys
import dap_node.lean
with dap_node.lean.doing_without("ssl"):
    import shared.radios.ble
shared.radios.ble.ADAPTERS = pathlib.Path({str(folder / "adapters")!r})
if {LEAN!r} in sys.argv:
    import {LEAN}
    sys.argv = sys.argv[-4:]
    {LEAN}.main()
import dap_node.__main__
os.execv = lambda _, words: os.execve(sys.executable, [*sys.orig_argv[:3], *words[2:]], os.environ)
dap_node.__main__.main()
"""
    return [sys.executable, "-c", program, *command[3:], "--source", "ble:hci0"]


def with_likelihood(folder: Path, command: list[str]) -> list[str]:
    """Return what runs the same, but weighs likelihoods."""
    (folder / "dap.toml").write_text('[proximity]\nmethod = "likelihood"\n')
    return [*command, "--config", str(folder / "dap.toml")]


@pytest.mark.parametrize("does_all", [False, True])
def test_a_dap_at_work_is_small(
    benchmark: BenchmarkFixture, tmp_path: Path, does_all: bool
) -> None:
    """With keys, linked to a post, 20 stations heard by hostapd five times a second.

    As it is set, and with Bluetooth and the likelihood besides.
    """
    keys = Keys(tmp_path / "keys", ["post", "dap2"])
    rows = "".join(f"responder,r{n},{address}\n" for n, address in enumerate(ADDRESSES))
    (tmp_path / "stations.csv").write_text(f"role,id,address\n{rows}")
    heard: list[Received] = []
    with (
        FakeHostapd(tmp_path / "wlan0") as hostapd,
        open_zenoh("router", listen=["tls/127.0.0.1:0"], bundle=keys["post"]) as post,
    ):
        hostapd.stations = {
            address: {"rx_packets": 1, "rx_bytes": 9, "inactive_msec": 4, "signal": -60}
            for address in ADDRESSES
        }
        hostapd.busy = True
        post.subscribe("clew/v1/fire/dap/dap2/rssi", heard.append)
        command = command_line(tmp_path, keys["dap2"].folder, post.locators()[0])
        if does_all:
            command = with_likelihood(tmp_path, with_bluetooth(tmp_path, command))
        with subprocess.Popen(command, stderr=subprocess.DEVNULL) as process:
            try:
                wait_for(lambda: len(heard) > STATIONS, "the first scans")
                began_s, before = worked_s(process.pid), len(heard)
                wait_for(lambda: len(heard) - before >= SCANS * STATIONS, "scans to measure")
                scans = (len(heard) - before) / STATIONS
                share = (worked_s(process.pid) - began_s) / scans * RATE_HZ
                resident = resident_mb(process.pid)
                mapped = Path(f"/proc/{process.pid}/maps").read_text()
            finally:
                process.terminate()
        assert process.returncode == ExitCode.OK
    benchmark.extra_info |= {"resident_mb": round(resident, 1), "share_of_core": round(share, 4)}
    benchmark(lambda: None)
    assert resident < MOST_RESIDENT_MB
    assert not [name for name in ("scipy", "numpy", "numba", "matplotlib") if name in mapped]
    assert ("dbus_fast" in mapped) is does_all


def test_taking_the_kernels_answers_apart(benchmark: BenchmarkFixture) -> None:
    """A poll of 20 stations by netlink, from bytes to readings; the socket apart."""
    nl80211 = pytest.importorskip("pyroute2.netlink.nl80211")
    counters = StationCounters()
    packets = 0

    def poll() -> int:
        nonlocal packets
        packets += 1
        polled = []
        for address in ADDRESSES:
            raw = station(address, packets=packets, signal_dbm=-60, chains_dbm=(-61, -63))
            answer = nl80211.nl80211cmd(raw)
            answer.decode()
            polled.append(polled_station(answer))
        return len(counters.readings(each for each in polled if each is not None))

    poll()
    assert benchmark(poll) == STATIONS
