"""A DAP tells how its box is and why it goes off, and the commander reads it when it is dead."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import cast

import pytest

from command_post.incident import Incident, IncidentSettings
from command_post.nodes.box_words import box_words
from command_post.nodes.told import Told
from command_post.roster import RosterSettings, make_roster
from dap_node.at_work import follow_live
from dap_node.box import PERIOD_NS, Box, BoxDesk, look_at_box
from dap_node.node import DapNode
from dap_node.scanners.observation import Observation, Scan
from shared.bus.memory import MemoryNetwork
from shared.clock import ManualClock
from shared.codec import Refusal, decode, encode, parse_key
from shared.messages import DapInstallation, DapState, NeighbourHeard
from shared.node import Node
from shared.sender import Sender
from shared.units import NS_PER_S
from tests.stride_world import START_NS, key_of

HOT = Box(0.12, 81.4)


def state(seconds: float, box: Box = HOT, going: str | None = None, sequence: int = 0) -> DapState:
    return DapState(
        event_time_ns=START_NS + round(seconds * NS_PER_S), sequence=sequence,
        battery_share=box.battery_share, temperature_c=box.temperature_c, going=going,
    )  # fmt: skip


def shown_by_linux(root: Path, name: str, **values: str) -> None:
    (root / name).mkdir(parents=True)
    for file, value in values.items():
        (root / name / file).write_text(f"{value}\n")


def test_linux_shows_the_fullest_battery_and_the_hottest_zone(tmp_path: Path) -> None:
    power, thermal = tmp_path / "power", tmp_path / "thermal"
    assert look_at_box(power, thermal) == Box(None, None)
    shown_by_linux(power, "AC", type="Mains", online="1")
    shown_by_linux(power, "BAT0", type="Battery", capacity="7")
    shown_by_linux(power, "BAT1", type="Battery", capacity="64")
    shown_by_linux(power, "BAT2", type="Battery", capacity="nonsense")
    shown_by_linux(thermal, "thermal_zone0", temp="45500")
    shown_by_linux(thermal, "thermal_zone1", temp="71250")
    shown_by_linux(thermal, "thermal_zone2", temp="999999999")
    shown_by_linux(thermal, "thermal_zone3")
    assert look_at_box(power, thermal) == Box(0.64, 71.25)


class Post:
    """Hears what a DAP says of its box."""

    def __init__(self) -> None:
        network = MemoryNetwork()
        self.bus = network.connect()
        self.heard: list[DapState] = []
        network.connect().subscribe("clew/v1/fire/dap/d1/state", lambda got: self._hear(*got))

    def _hear(self, key_text: str, payload: bytes) -> None:
        key = parse_key(key_text)
        assert not isinstance(key, Refusal)
        said = decode(key, payload)
        assert isinstance(said, DapState)
        self.heard.append(said)

    def sender(self) -> Sender:
        """Return what a part of the node says its messages by."""
        return Sender(self.bus, "fire", "dap", "d1")


def test_it_is_told_every_ten_seconds_and_at_the_end() -> None:
    post = Post()
    desk = BoxDesk(post.sender(), lambda: HOT)
    for tick in range(101):
        desk.pass_time(START_NS + tick * PERIOD_NS // 50)
    desk.go_off(START_NS + 3 * PERIOD_NS, "switched off")
    assert [each.going for each in post.heard] == [None, None, None, "switched off"]
    assert {(each.battery_share, each.temperature_c) for each in post.heard} == {HOT}


class _Bare:
    """As much of a node as listening takes."""

    def __init__(self, post: Post) -> None:
        self.sender = post.sender
        self.clock = ManualClock(START_NS + 5)


@pytest.mark.parametrize("fails", [False, True])
def test_a_dap_that_ends_says_goodbye_and_why(fails: bool) -> None:
    post = Post()

    def observations() -> Iterator[Observation]:
        yield Scan(START_NS, {})
        if fails:
            raise OSError("the radio was torn off")

    dap = DapNode(post.bus, "fire", "d1")
    node = cast("Node", _Bare(post))
    if fails:
        with pytest.raises(OSError, match="torn off"):
            follow_live(node, dap, observations())
    else:
        follow_live(node, dap, observations())
    goodbye = "failed: the radio was torn off" if fails else "switched off"
    assert [each.going for each in post.heard] == [None, goodbye]


@pytest.mark.parametrize(
    ("said", "silent_s", "words"),
    [
        (state(0.0, Box(0.9, 40.0)), 1.0, []),
        (state(0.0), 1.0, ["battery at 12%", "81 °C hot"]),
        (state(0.0), 11.0, ["fell silent, last battery at 12%, 81 °C hot"]),
        (
            state(0.0, Box(0.9, None)),
            11.0,
            ["fell silent without a word: out of reach, or destroyed (battery at 90% before)"],
        ),
        (state(0.0, Box(0.9, 40.0), "switched off"), 1.0, ["went off: switched off"]),
        (None, 100.0, []),
    ],
)
def test_what_a_commander_reads(said: DapState | None, silent_s: float, words: list[str]) -> None:
    assert [*box_words(said, round(silent_s * NS_PER_S))] == words


def near(dap_id: str, seconds: float) -> NeighbourHeard:
    return NeighbourHeard(
        event_time_ns=START_NS + round(seconds * NS_PER_S), sequence=round(seconds), dap_id=dap_id,
        rssi_mean_dbm=-70.0, rssi_variance_db2=4.0, sample_count=9,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("goes", "still_heard_s", "words"),
    [
        (None, 80.0, "its radio is still heard by d2: only its link is lost"),
        (None, 5.0, "its radio is heard no more by d2 either: it is off, or destroyed"),
        (None, None, None),
        ("switched off", 5.0, None),
    ],
)
def test_who_else_hears_a_dead_dap_tells_what_became_of_it(
    goes: str | None, still_heard_s: float | None, words: str | None
) -> None:
    told = Told()
    told.take("dap", "d1", state(0.0, Box(0.9, None), goes), START_NS)
    for seconds in range(0, 101, 5):
        if still_heard_s is not None:
            heard = near("d1" if seconds <= still_heard_s else "d3", seconds)
            told.take("dap", "d2", heard, heard.event_time_ns)
    now_ns = START_NS + 100 * NS_PER_S
    assert told.of_box("d1", 100 * NS_PER_S, now_ns)[1:] == ([words] if words else [])
    goodbye = [] if goes is None else [f"went off: {goes}"]
    assert told.of_box("d1", 0, START_NS + NS_PER_S) == goodbye


def test_it_is_told_that_a_box_was_taken_up_shortly_before() -> None:
    up = DapInstallation(event_time_ns=START_NS, sequence=0, installer_id=None, position=None)
    for later_s, words in ((50, ["taken up 50 s before it fell silent"]), (70, [])):
        told = Told()
        told.take("dap", "d1", up, START_NS)
        told.take("dap", "d1", state(later_s, Box(0.9, None)), START_NS + later_s * NS_PER_S)
        now_ns = START_NS + (later_s + 30) * NS_PER_S
        assert told.of_box("d1", 30 * NS_PER_S, now_ns)[1:] == words


def test_a_radio_that_is_gone_is_told() -> None:
    post = Post()
    BoxDesk(post.sender(), lambda: Box(0.9, 30.0), lambda: ["ble:hci0"]).pass_time(START_NS)
    (said,) = post.heard
    assert [*box_words(said, 0)] == ["ble:hci0 is gone"]
    assert [*box_words(said, 11 * NS_PER_S)] == ["fell silent, last ble:hci0 is gone"]


def test_a_dead_dap_is_shown_with_when_and_why_until_it_is_back() -> None:
    incident = Incident(IncidentSettings())

    def fault_at(seconds: float) -> tuple[str, str | None]:
        now_ns = START_NS + round(seconds * NS_PER_S)
        (row,) = make_roster(incident, now_ns, RosterSettings()).daps
        return row.reason, row.fault

    key = str(key_of("dap", "d1", DapState))
    incident.handle(key, encode(state(0.0)), START_NS)
    assert fault_at(1.0)[1] == "battery at 12%; 81 °C hot"
    reason, fault = fault_at(100.0)
    assert (reason, fault) == (
        "nothing heard for 100 s", "fell silent, last battery at 12%, 81 °C hot",
    )  # fmt: skip
    back = state(120.0, Box(1.0, 30.0))
    incident.handle(key, encode(back), back.event_time_ns)
    assert fault_at(121.0)[1] is None
    off = state(130.0, Box(1.0, 30.0), "switched off", sequence=1)
    incident.handle(key, encode(off), off.event_time_ns)
    assert fault_at(131.0)[1] == "went off: switched off"
