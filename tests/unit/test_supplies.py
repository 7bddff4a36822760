"""What nodes have left: read where their machines tell it, and alerted to when it is little."""

from __future__ import annotations

import os
import time
from pathlib import Path

import pytest

from command_post.desks.alert_desk import SILENT_NS, AlertDesk, Node
from command_post.nodes.supplies import SupplyWatch, short_of, why_silent
from edge_agent.supply_gauge import SupplyGauge
from shared.battery import read_battery
from shared.messages import Alert, Beat, DapInstallation, DapState, LocalPosition, Supplies
from shared.units import NS_PER_S

R1: Node = ("responder", "r1")
DAP: Node = ("dap", "dap1")


def beat(supplies: Supplies | None = None, *, leaves: bool = False) -> Beat:
    return Beat(
        event_time_ns=0, sequence=0, run="0" * 16, last_number=0, kept_from=0, acknowledged=0,
        supplies=supplies, leaves=leaves,
    )  # fmt: skip


def box(share: float, temperature_c: float | None = None, going: str | None = None) -> DapState:
    return DapState(
        event_time_ns=0, sequence=0, battery_share=share, temperature_c=temperature_c, going=going
    )


def test_little_is_told_once_worse_once_more_and_no_more_from_a_higher_limit() -> None:
    watch = SupplyWatch()

    def told(charge: float, *, charging: bool = False) -> list[str | None]:
        return [short.words for short in watch.take(Supplies(battery=charge, charging=charging))]

    assert told(0.21) == []
    assert told(0.20) == ["battery at 20%"]
    assert [told(charge) for charge in (0.21, 0.19, 0.24, 0.15)] == [[], [], [], []]
    assert told(0.10) == ["battery at 10%"]
    assert told(0.12) == []
    assert told(0.25) == [None]
    assert told(0.2) == ["battery at 20%"]
    assert told(0.2, charging=True) == [None]


def test_the_table_tells_only_of_what_is_little() -> None:
    assert short_of(None) == short_of(Supplies(battery=0.9, air_bar=200.0)) == ()
    assert short_of(Supplies(battery=0.1, charging=True)) == ()
    assert short_of(Supplies(battery=0.1, air_left_s=120.0)) == ("battery at 10%", "air for 2 min")


def test_air_is_little_by_its_pressure_or_by_its_time() -> None:
    watch = SupplyWatch()
    assert watch.take(Supplies(air_bar=200.0, air_left_s=1200.0)) == []
    (short,) = watch.take(Supplies(air_bar=100.0, air_left_s=290.0))
    assert (short.kind, short.words) == ("low_air", "air at 100 bar, air for 5 min")
    (short,) = watch.take(Supplies(air_bar=29.0, air_left_s=290.0))
    assert short.words == "air at 29 bar, air for 5 min"
    assert watch.take(Supplies(air_bar=300.0, air_left_s=350.0)) == []
    assert watch.take(Supplies(air_bar=300.0, air_left_s=1500.0)) == [("low_air", None)]


@pytest.mark.parametrize(
    ("last", "why"),
    [
        ((0.06, None), "nothing heard for 10 s: its battery was at 6%"),
        ((0.5, 78.0), "nothing heard for 10 s: it was at 78 °C"),
        (None, "nothing heard for 10 s: its link is lost, or it has failed"),
    ],
)
def test_a_dap_that_falls_silent_is_dead_of_what_it_told_last(
    last: tuple[float, float | None] | None, why: str
) -> None:
    desk = AlertDesk(0)
    desk.hear(DAP, beat(), NS_PER_S)
    raised = [] if last is None else desk.hear(DAP, box(*last), NS_PER_S)
    assert all(alert.kind == "low_battery" for alert in raised)
    (dead,) = desk.pass_time(NS_PER_S + SILENT_NS)
    assert (dead.kind, dead.words) == ("dap_dead", why)
    (back,) = desk.hear(DAP, beat(), 60 * NS_PER_S)
    assert (back.number, back.stage) == (dead.number, "resolved")
    assert desk.pass_time(60 * NS_PER_S) == []
    assert why_silent("responder", None) is None


def test_who_is_switched_off_says_so_and_is_missed_at_once_and_once() -> None:
    desk = AlertDesk(0)
    desk.hear(DAP, beat(), 0)
    assert desk.hear(DAP, box(0.9, going="failed: no radio"), 0) == []
    (off,) = desk.hear(DAP, beat(leaves=True), NS_PER_S)
    assert (off.kind, off.words) == ("dap_dead", "went off: failed: no radio")
    assert desk.hear(DAP, beat(leaves=True), NS_PER_S) == []
    assert desk.pass_time(60 * NS_PER_S) == []
    desk.hear(R1, beat(), 0)
    (left,) = desk.hear(R1, beat(leaves=True), NS_PER_S)
    assert (left.kind, left.words) == ("lost_contact", "switched off")
    assert desk.hear(R1, beat(), 2 * NS_PER_S)[0].stage == "resolved"
    (silent,) = desk.pass_time(100 * NS_PER_S)
    assert silent.since_ns == 2 * NS_PER_S + SILENT_NS


def test_a_dap_that_was_taken_up_has_moved_until_it_is_set_down() -> None:
    desk = AlertDesk(0)

    def says(event_ns: int, position: LocalPosition | None) -> list[Alert]:
        said = DapInstallation(
            event_time_ns=event_ns, sequence=0, installer_id=None, position=position
        )
        return desk.hear(DAP, said, 100)

    here = LocalPosition(north_m=0.0, east_m=0.0, down_m=0.0, covariance_m2=(1.0, 0.0, 1.0))
    assert says(1, here) == []
    (moved,) = says(5, None)
    assert (moved.kind, moved.stage) == ("dap_moved", "raised")
    assert says(3, here) == [], "late, out of its journal"
    (over,) = says(9, here)
    assert over.stage == "resolved"


def machine(folder: Path, **files: str) -> None:
    folder.mkdir(parents=True)
    for name, text in files.items():
        (folder / name).write_text(f"{text}\n")


def test_the_fullest_battery_of_the_machine_counts_and_a_mouse_has_none(tmp_path: Path) -> None:
    assert read_battery(tmp_path / "none") is None
    machine(tmp_path / "AC", type="Mains")
    machine(tmp_path / "BAT0", type="Battery", capacity="83", status="Discharging", temp="412")
    machine(tmp_path / "BAT1", type="Battery", energy_now="30", energy_full="100", status="Full")
    machine(tmp_path / "mouse", type="Battery", scope="Device", capacity="5")
    assert read_battery(tmp_path) == Supplies(battery=0.83, temperature_c=41.2)
    (tmp_path / "BAT0" / "capacity").write_text("nonsense\n")
    assert read_battery(tmp_path) == Supplies(battery=0.3, charging=True)


def test_a_file_tells_what_the_machine_does_not(tmp_path: Path) -> None:
    told = tmp_path / "air.json"
    machine(tmp_path / "power" / "BAT0", type="Battery", capacity="83")
    told.write_text('{"air_bar": 182, "air_left_s": 1260.0}')
    known = SupplyGauge(told, tmp_path / "power")()
    assert known == Supplies(battery=0.83, air_bar=182.0, air_left_s=1260.0)
    told.write_text('{"air_bar": -3}')
    assert SupplyGauge(told, tmp_path / "power")() == Supplies(battery=0.83)
    assert SupplyGauge(told, tmp_path / "none")() is None


def test_a_file_counts_as_long_as_it_is_written_anew_however_the_clock_is_set(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    told = tmp_path / "air.json"
    gauge = SupplyGauge(told, tmp_path / "none")
    begun_s, really = time.monotonic(), time.time

    def known_after(seconds: float, *, written: bool) -> Supplies | None:
        monkeypatch.setattr("edge_agent.supply_gauge.time.monotonic", lambda: begun_s + seconds)
        if written:
            told.write_text('{"air_bar": 182}')
            os.utime(told, ns=(0, round(seconds)))
        return gauge()

    told.write_text('{"air_bar": 182}')
    assert gauge() == Supplies(air_bar=182.0)
    monkeypatch.setattr("edge_agent.supply_gauge.time.time", lambda: really() + 10_800.0)
    assert known_after(30.0, written=False) == Supplies(air_bar=182.0)
    assert known_after(80.0, written=True) == Supplies(air_bar=182.0)
    monkeypatch.setattr("edge_agent.supply_gauge.time.time", lambda: really() - 10_800.0)
    assert known_after(150.0, written=False) is None
