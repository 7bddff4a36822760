"""What is exported of a recording: all of it, at its place on the Earth, and nothing by halves."""

from __future__ import annotations

import csv
import hashlib
import io
import re
from collections.abc import Iterator
from pathlib import Path

import msgspec
import numpy as np
import pytest
from defusedxml.ElementTree import fromstring

from command_post.__main__ import app
from command_post.commands.export import _write
from command_post.exports.formats import exported
from command_post.exports.maps import GOOGLE, KML, geojson_of, kml_of
from command_post.exports.material import Material, iso, material_of
from command_post.exports.report import report_of
from command_post.exports.table import csv_of
from command_post.fusion.interface import Afterwards, SmoothedTrack
from command_post.review.past import Past
from shared.geodesy import Origin
from shared.mcap_index import IndexedRecording
from shared.process import ExitCode
from tests.eventful import eventful

ORIGIN = Origin(latitude_deg=37.5665, longitude_deg=126.978, height_m=38.0, bearing_deg=90.0)
AFTER = Afterwards(
    {"r1": SmoothedTrack(np.array([1.8e9, 1.8e9 + 5.0]), np.ones((2, 3)), np.ones((2, 3)))}, {}
)


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return eventful(tmp_path_factory.mktemp("exports") / "eventful.mcap")


@pytest.fixture(scope="module")
def material(path: Path) -> Iterator[Material]:
    with IndexedRecording([path]) as recording:
        yield material_of(Past(recording), AFTER)


def test_the_table_has_every_moment_of_everybody(material: Material) -> None:
    rows = list(csv.DictReader(io.StringIO(csv_of(material, ORIGIN).decode())))
    assert len(rows) == len(material.stances)
    assert {row["responder"] for row in rows} == {"r1", "r2", "r3"}
    assert {row["track"] for row in rows} == {"live", "afterwards"}
    stance, row = next(
        each for each in zip(material.stances, rows, strict=True) if each[0].kind == "live"
    )
    assert (row["time"], row["north_m"]) == (iso(stance.time_ns), f"{stance.place_m[0]:.3f}")
    place = ORIGIN.geodetic(*stance.place_m)
    assert float(row["latitude_deg"]) == pytest.approx(place.latitude_deg, abs=1e-7)
    assert float(row["longitude_deg"]) == pytest.approx(place.longitude_deg, abs=1e-7)
    assert "latitude_deg" not in csv_of(material, None).decode().splitlines()[0]


def test_all_places_at_once_are_those_one_by_one() -> None:
    places_m = np.array([[1.0, 2.0, -3.0], [-100.0, 50.0, 0.0]])
    one_by_one = [ORIGIN.geodetic(*each) for each in places_m.tolist()]
    np.testing.assert_allclose(ORIGIN.all_geodetic(places_m), one_by_one, rtol=0.0, atol=1e-12)


def test_geojson_has_tracks_with_times_and_what_happened(material: Material) -> None:
    told = msgspec.json.decode(geojson_of(material, ORIGIN))
    tracks = [each for each in told["features"] if each["properties"]["kind"] == "track"]
    assert len(tracks) == 4
    for each in tracks:
        assert len(each["properties"]["times"]) == len(each["geometry"]["coordinates"])
    (mayday,) = [each for each in told["features"] if each["properties"]["kind"] == "mayday"]
    assert mayday["properties"]["of"] == "r2"
    assert mayday["properties"]["until"] == "2026-01-01T00:01:30.000Z"
    longitude, latitude, _ = mayday["geometry"]["coordinates"]
    assert (longitude, latitude) == pytest.approx((126.978, 37.5665), abs=1e-3)


def test_kml_has_tracks_with_as_many_times_as_places(material: Material) -> None:
    root = fromstring(kml_of(material, ORIGIN))
    tracks = root.findall(f".//{{{GOOGLE}}}Track")
    assert len(tracks) == 4
    for track in tracks:
        whens = track.findall(f"{{{KML}}}when")
        assert len(whens) == len(track.findall(f"{{{GOOGLE}}}coord")) > 1
    names = [each.text for each in root.findall(f".//{{{KML}}}name")]
    assert "mayday: r2" in names
    assert "access point: dap1" in names


def test_the_report_says_what_happened_and_stands_by_itself(material: Material, path: Path) -> None:
    report = report_of(material, path).decode()
    for words in (
        "00:01:05 acknowledged by kim (after 5 s)", "00:01:30 resolved by kim (after 30 s)",
        "00:02:03 acknowledged by r1 (after 3 s)", "north door; to: everybody",
        "never acknowledged by r2",
        "nothing was received", hashlib.sha256(path.read_bytes()).hexdigest(), "<b>team</b>",
        "Floor 0",
    ):  # fmt: skip
        assert words in report
    assert re.findall(r'(?:src|href)="(?!data:)', report) == []
    assert len(re.findall(r'<img src="data:image/png', report)) == len(material.floors) + 1
    assert "<script" not in report


def test_words_of_others_are_no_markup(material: Material, path: Path) -> None:
    (mayday, *others) = material.timeline.marks
    hostile = msgspec.structs.replace(mayday, words="<script>alert(1)</script>")
    line = msgspec.structs.replace(material.timeline, marks=[hostile, *others])
    assert b"<script" not in report_of(material._replace(timeline=line), path)


def test_an_ending_that_is_none_and_a_place_that_is_missing_are_refused(
    material: Material, path: Path
) -> None:
    with pytest.raises(ValueError, match="where on the Earth"):
        exported(".kml", material, path, None)
    with pytest.raises(ValueError, match="use one of"):
        exported(".doc", material, path, None)


def test_the_command_writes_all_or_refuses_before(path: Path, tmp_path: Path) -> None:
    def export(*words: str) -> int:
        command = ["export", str(path), *words]
        code = app(command, exit_on_error=False, result_action="return_value")
        assert isinstance(code, int)
        return code

    table, lines = tmp_path / "a.csv", tmp_path / "a.geojson"
    assert export("--output", str(table), "--output", str(lines)) == ExitCode.USAGE
    assert list(tmp_path.iterdir()) == []
    origin = ("--origin", "37.5665,126.978")
    assert export("--output", str(table), "--output", str(lines), *origin) == ExitCode.OK
    assert sorted(tmp_path.iterdir()) == [table, lines]
    assert export("--output", str(tmp_path / "no" / "a.csv")) == ExitCode.USAGE


def test_what_cannot_be_written_is_named_as_it_was_given(tmp_path: Path) -> None:
    path = tmp_path / "nowhere" / "x.html"
    with pytest.raises(OSError, match=f"^{re.escape(str(path))}: cannot be written "):
        _write(path, b"")
