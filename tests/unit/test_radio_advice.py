"""A wearer's radio and strides together: who carries DAPs in is told when one is needed.

The radio is wpa_supplicant's, as ``edge-agent run --radio wpa:...`` asks it.
"""

from __future__ import annotations

from pathlib import Path
from threading import Event
from typing import cast

from edge_agent.drop_desk import DropDesk
from edge_agent.radio_desk import RadioDesk
from shared.bus.memory import MemoryNetwork
from shared.bus.zenoh_bus import ZenohBus
from shared.clock import PacedClock, SystemClock
from shared.drop_adviser import Advice
from shared.kept_stations import KeptStations
from shared.messages import StationTable
from shared.node import Node
from shared.outbox import JournalledOutbox
from shared.radios.readings import RadioScan
from shared.radios.station_counters import StationCounters
from shared.radios.wpa import WpaRadio
from shared.units import NS_PER_S
from tests.fake_hostapd import FakeWpa
from tests.stride_world import START_NS, stride

DAP = "02:00:5e:10:00:81"
TABLE = StationTable(event_time_ns=5, sequence=0, responders=(), daps=((DAP, "d1"),))
STRIDE_M = 1.2


def told_on_the_way(folder: Path, levels_dbm: list[int]) -> list[Advice]:
    """Walk north, a stride for each level of the access point that it is linked to."""
    told: list[Advice] = []
    KeptStations(folder / "r1.journal").keep(TABLE)
    with (
        FakeWpa(folder / "wlan0") as wpa,
        JournalledOutbox(folder / "r1.journal") as outbox,
    ):
        node = Node(
            cast("ZenohBus", MemoryNetwork().connect()), "fire", "responder", "r1", outbox, None,
            PacedClock(SystemClock()), START_NS, Event(),
        )  # fmt: skip
        drops = DropDesk(node.sender(), 2, told.append)
        desk = RadioDesk(node, [], KeptStations(folder / "r1.journal"), 10.0, drops)
        radio, counters = WpaRadio(folder / "wlan0"), StationCounters()
        for number, level_dbm in enumerate(levels_dbm, 1):
            wpa.link = (DAP, level_dbm)
            now_ns = START_NS + round(1.1 * number * NS_PER_S)
            desk.take(RadioScan(now_ns - 1, counters.readings(list(radio.poll()))))
            drops.move(stride(1.1 * number, STRIDE_M, 0.0, sequence=number))
        radio.close()
    return told


def test_a_box_is_asked_for_where_the_link_breaks_as_the_radio_of_the_unit_hears_it(
    tmp_path: Path,
) -> None:
    (advice,) = told_on_the_way(tmp_path, [-60 - 6 * step for step in range(8)])
    assert "link at" in advice.reason
    assert "dBm, falling" in advice.reason


def test_none_is_asked_for_while_one_is_loud_once_its_readings_are_brought_to_scale(
    tmp_path: Path,
) -> None:
    """-90 dBm would be a link all but gone, but this radio hears 10 dB too little."""
    assert told_on_the_way(tmp_path, [-90] * 6) == []
