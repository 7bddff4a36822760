"""Whose radio is whose: files that say so, and what is wrong with some."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from shared.config import ConfigError
from shared.kept_stations import KeptStations
from shared.messages import StationTable
from shared.stations import Stations, parse_address, read_stations

UUID = "f0000000-0000-4000-8000-00000000000a"


def file(folder: Path, text: str, name: str = "stations.toml") -> Path:
    path = folder / name
    path.write_text(text)
    return path


@pytest.mark.parametrize(
    ("text", "address"),
    [
        ("02:00:5E:10:00:01", "02:00:5e:10:00:01"),
        ("02-00-5e-10-00-01", "02:00:5e:10:00:01"),
        (" 02005e100001 ", "02:00:5e:10:00:01"),
        (UUID.upper(), UUID),
        (f"{UUID}/007/65535", f"{UUID}/7/65535"),
    ],
)
def test_an_address_is_the_same_however_it_is_written(text: str, address: str) -> None:
    assert parse_address(text) == parse_address(address) == address


@pytest.mark.parametrize(
    "text",
    ["", "r1", "02:00:5e:10:00", "02:00:5e:10:00:0g", "0:20:05:e1:00:001", "ff:ff:ff:ff:ff:ff",
     "00:00:00:00:00:00", f"{UUID}/1", f"{UUID}/1/65536", UUID[1:]],
)  # fmt: skip
def test_what_is_no_address_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match="write six bytes as in 02:00"):
        parse_address(text)


@given(st.binary(min_size=6, max_size=6))
def test_every_radio_has_one_spelling(raw: bytes) -> None:
    spellings = {raw.hex(), raw.hex(":"), raw.hex("-").upper()}
    if raw not in (bytes(6), b"\xff" * 6):
        assert {parse_address(text) for text in spellings} == {raw.hex(":")}


def test_toml_and_csv_say_the_same(tmp_path: Path) -> None:
    toml = file(
        tmp_path,
        f'[responders]\nr1 = "02:00:5e:10:00:01"\nr2 = ["02:00:5e:10:00:02", "{UUID}/1/2"]\n'
        '[daps]\ndap1 = "02:00:5e:10:00:81"\n',
    )
    csv = file(
        tmp_path,
        "\ufeffrole,id,address\nresponder,r1,02-00-5E-10-00-01\nresponder,r2,02005e100002\n"
        f"\nresponder, r2 ,{UUID}/1/2\ndap,dap1,02:00:5e:10:00:81\n",
        "stations.csv",
    )
    table = read_stations(toml)
    assert table == read_stations(csv)
    assert table.daps == (("02:00:5e:10:00:81", "dap1"),)
    known = Stations(table)
    assert len(known) == 4
    assert known.whose(f"{UUID}/1/2") == ("responder", "r2")
    assert known.whose("02:00:5e:10:00:81") == ("dap", "dap1")
    assert known.whose("02:00:5e:10:00:82") is None


@pytest.mark.parametrize(
    ("name", "text", "complaint"),
    [
        ("t.toml", '[responders]\nr1 = "02:00:5e:10:00"', "responders.r1: address '02:00:5e"),
        ("t.toml", '[responders]\n"r 1" = "02:00:5e:10:00:01"', "responder id 'r 1'"),
        ("t.toml", '[responder]\nr1 = "02:00:5e:10:00:01"', "did you mean 'responders'"),
        ("t.toml", '[daps]\nd1 = "02:00:5e:10:00:01"\nd2 = "02005E100001"',
         "daps.d2: 02:00:5e:10:00:01 is listed already, as of d1"),
        ("t.csv", "responder,r1,02:00:5e:10:00:01", "begin with the line role,id,address"),
        ("t.csv", "role,id,address\npost,p,02:00:5e:10:00:01", "line 2: role 'post'"),
        ("t.csv", "role,id,address\nresponder,r1", "line 2: write role,id,address"),
        ("t.csv", "role,id,address\ndap,d1,02005e100001\ndap,d1,02005e100001", "line 3: 02:00"),
    ],
)  # fmt: skip
def test_mistakes_are_told_where_they_are(
    tmp_path: Path, name: str, text: str, complaint: str
) -> None:
    with pytest.raises(ConfigError, match=complaint):
        read_stations(file(tmp_path, text, name))


def test_a_file_that_is_not_there_or_too_long_is_told(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="cannot be read"):
        read_stations(tmp_path / "none.csv")
    rows = "".join(f"dap,{'d' * 28}{n:04},{0x020000000000 + n:012x}\n" for n in range(1500))
    with pytest.raises(ConfigError, match="1500 addresses are too many"):
        read_stations(file(tmp_path, f"role,id,address\n{rows}", "long.csv"))


def test_a_table_outlives_the_process(tmp_path: Path) -> None:
    kept = KeptStations(tmp_path / "dap1.journal")
    assert kept.load() is None
    table = StationTable(
        event_time_ns=5, sequence=2, responders=(("02:00:5e:10:00:01", "r1"),), daps=()
    )
    kept.keep(table)
    assert KeptStations(tmp_path / "dap1.journal").load() == table
    (tmp_path / "dap1.journal.stations").write_text("{}")
    assert kept.load() is None
