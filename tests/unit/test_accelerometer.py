"""The box's own accelerometer, read as Linux shows it."""

from __future__ import annotations

from pathlib import Path
from threading import Event, Thread

import pytest
from structlog.testing import capture_logs

from dap_node.scanners import accelerometer
from dap_node.scanners.accelerometer import SAMPLES_AT_ONCE, IioAccelerometer
from dap_node.scanners.observation import Motion
from shared.clock import SystemClock
from shared.radios.readings import RadioScan, ScannerError
from tests.waiting import DEADLINE_S, wait_for


@pytest.fixture
def device(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A device that lies still: 16384 is 1 g, and its z axis has a scale and offset of its own."""
    monkeypatch.setattr(accelerometer, "DEVICES", tmp_path)
    folder = tmp_path / "iio:device0"
    folder.mkdir()
    for name, value in {
        "in_accel_x_raw": "0", "in_accel_y_raw": "1000", "in_accel_z_raw": "-8000",
        "in_accel_scale": "0.001", "in_accel_z_scale": "0.002", "in_accel_z_offset": "3000",
    }.items():  # fmt: skip
        (folder / name).write_text(f"{value}\n")
    return folder


def test_it_is_read_steadily_and_a_fault_is_said_once(
    device: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(accelerometer, "TRY_AGAIN_S", 0.001)
    source, stop, found = IioAccelerometer("iio:0", rate_hz=1000.0), Event(), list[Motion]()

    def deliver(motion: RadioScan | Motion) -> None:
        assert isinstance(motion, Motion)
        found.append(motion)

    thread = Thread(target=source.listen, args=(deliver, SystemClock().now_ns, stop))
    with capture_logs() as logs:
        thread.start()
        wait_for(lambda: found, "samples")
        (device / "in_accel_x_raw").write_text("nothing")
        wait_for(lambda: logs, "the fault to be said")
        (device / "in_accel_x_raw").write_text("1")
        before = len(found)
        wait_for(lambda: len(found) > before + 1, "samples again")
        stop.set()
        thread.join(DEADLINE_S)
    assert [entry["event"] for entry in logs] == ["the accelerometer fails"]
    assert {len(motion.samples) for motion in found} == {SAMPLES_AT_ONCE}
    assert found[0].samples[0][1] == pytest.approx((0.0, 1.0, -10.0))
    assert found[0].time_ns == found[0].samples[-1][0]


@pytest.mark.parametrize(
    ("name", "complaint"),
    [("iio:3", "no accelerometer to be read there"), ("spi:0", "write iio:NUMBER"),
     ("iio:", "write iio:NUMBER")],
)  # fmt: skip
def test_one_that_is_not_there_is_told(device: Path, name: str, complaint: str) -> None:
    with pytest.raises(ScannerError, match=complaint):
        IioAccelerometer(name)
