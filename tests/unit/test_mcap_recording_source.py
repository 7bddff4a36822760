"""The samples a recording gives back are those the mount was given, once each, in time order."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import pytest
from msgspec import structs

from command_post.recorder.file import RecordingFile
from edge_agent.sources.mcap_recording import read_imu_samples
from shared.codec import encode
from shared.mcap_reader import RecordingError
from shared.messages import ImuBatch, ImuSample
from tests.traffic import START_NS, imu_batch, key_of, traffic


def recorded(path: Path, batches: Iterable[tuple[str, ImuBatch]]) -> Path:
    file = RecordingFile(path, {})
    for time_ns, key, payload in traffic(3):
        file.put(key, payload, time_ns)
    for responder, batch in batches:
        file.put(key_of("responder", responder, "imu"), encode(batch), START_NS)
    file.put(key_of("responder", "r1", "imu"), b"garbage", START_NS)
    file.finish()
    return path


def times_of(batches: Iterable[ImuBatch]) -> list[int]:
    return [time_ns for batch in batches for time_ns in batch.time_ns]


def test_samples_come_back_as_they_were(tmp_path: Path) -> None:
    batch = imu_batch(0, samples=2, with_field=True)
    assert list(read_imu_samples(recorded(tmp_path / "a.mcap", [("r1", batch)]))) == [
        ImuSample(START_NS, (0.0, 0.5, 1.0), (0.0, -0.5, -1.0), (0.0, 0.5, 1.0)),
        ImuSample(START_NS + 10_000_000, (1.0, 1.5, 2.0), (-1.0, -1.5, -2.0), (1.0, 1.5, 2.0)),
    ]


def test_without_a_magnetometer_there_is_no_field(tmp_path: Path) -> None:
    (sample,) = read_imu_samples(recorded(tmp_path / "a.mcap", [("r1", imu_batch(0, samples=1))]))
    assert sample.field_ut is None


def test_a_barometer_slower_than_the_rest_comes_back_at_its_samples(tmp_path: Path) -> None:
    batch = imu_batch(0, samples=5)
    batch = structs.replace(batch, pressure_pa=(101_325.0, 101_320.5), pressure_rows=(1, 4))
    samples = read_imu_samples(recorded(tmp_path / "a.mcap", [("r1", batch)]))
    pressures_pa = [sample.pressure_pa for sample in samples]
    assert pressures_pa == [None, 101_325.0, None, None, 101_320.5]


@pytest.mark.parametrize("rows", [(1, 5), (3, 3), (4, 1), (1,)])
def test_pressures_that_fit_no_samples_are_refused(tmp_path: Path, rows: tuple[int, ...]) -> None:
    batch = imu_batch(7, samples=5)
    batch = structs.replace(batch, pressure_pa=(101_325.0, 101_320.5), pressure_rows=rows)
    path = recorded(tmp_path / "a.mcap", [("r1", batch)])
    with pytest.raises(RecordingError, match="batch 7 has 2 pressures for"):
        list(read_imu_samples(path))


def test_late_and_repeated_batches_take_their_place_once(tmp_path: Path) -> None:
    batches = [imu_batch(number) for number in range(4)]
    arrived = [("r1", batches[number]) for number in (0, 2, 2, 1, 0, 3)]
    samples = read_imu_samples(recorded(tmp_path / "a.mcap", arrived))
    assert [sample.time_ns for sample in samples] == times_of(batches)


def test_an_agent_that_starts_anew_counts_from_0_and_loses_nothing(tmp_path: Path) -> None:
    batches = [imu_batch(0), imu_batch(1), imu_batch(2), imu_batch(3)]
    anew = [structs.replace(batch, sequence=batch.sequence % 2) for batch in batches]
    samples = read_imu_samples(recorded(tmp_path / "a.mcap", [("r1", one) for one in anew]))
    assert [sample.time_ns for sample in samples] == times_of(batches)


def test_batches_that_overlap_do_not_go_back_in_time(tmp_path: Path) -> None:
    batches = [imu_batch(0, samples=25), imu_batch(1, samples=20)]
    samples = read_imu_samples(recorded(tmp_path / "a.mcap", [("r1", one) for one in batches]))
    times = [sample.time_ns for sample in samples]
    assert times == sorted(set(times_of(batches)))
    assert len(times) == 40


def test_one_of_several_responders_is_chosen(tmp_path: Path) -> None:
    path = recorded(tmp_path / "a.mcap", [("r1", imu_batch(0)), ("r2", imu_batch(1))])
    chosen = read_imu_samples(path, "r2")
    assert [sample.time_ns for sample in chosen] == list(imu_batch(1).time_ns)
    with pytest.raises(RecordingError, match=r"samples of r1, r2; name one, as in .*a\.mcap#r1"):
        list(read_imu_samples(path))
    with pytest.raises(RecordingError, match="no samples of r3; there are some of r1, r2"):
        list(read_imu_samples(path, "r3"))


def test_a_recording_without_samples_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="no inertial samples in it"):
        list(read_imu_samples(recorded(tmp_path / "a.mcap", [])))


def test_a_batch_whose_lists_do_not_fit_is_refused(tmp_path: Path) -> None:
    batch = structs.replace(imu_batch(7), rate_rad_s=(0.0,) * 74)
    path = recorded(tmp_path / "a.mcap", [("r1", batch)])
    with pytest.raises(RecordingError, match="batch 7 has 25 times, but 75, 74 and 0 numbers"):
        list(read_imu_samples(path))


def test_what_is_no_recording_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "walk.csv"
    path.write_text("t,x,y,z\n", encoding="utf-8")
    with pytest.raises(RecordingError, match=r"walk\.csv: is not an MCAP file"):
        list(read_imu_samples(path))
