"""No file, however garbled, does worse than to be refused by name."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from edge_agent.sources.recording import Recording, SourceError
from edge_agent.sources.vendor_csv import read_vendor_csv

HEADERS = [
    "Time (s)", "t", "SampleTimeFine", "time [ns]", "Accelerometer X (g)", "acc_y", "Acc_Z",
    "acc_x_m_s2", "acc z (mg)", "Gyroscope X (deg/s)", "Gyr_Y", "gyr_z_rad_s", "Mag_X",
    "mag y (uT)", "mag_z_gauss", "", "Packet", "acc x (", "gyro () y", "[", "time (furlongs)",
]  # fmt: skip
cells = st.one_of(
    st.floats().map(str), st.integers(-(10**20), 10**20).map(str), st.text(max_size=5), st.just("")
)
rows = st.lists(cells, max_size=12)
tables = st.builds(
    lambda header, body, delimiter: "\n".join(delimiter.join(row) for row in [header, *body]),
    st.lists(st.sampled_from(HEADERS), max_size=12),
    st.lists(rows, max_size=8),
    st.sampled_from([",", ";", "\t"]),
)
LEGIBLE = "t_s,acc_x_m_s2,acc_y_m_s2,acc_z_m_s2,gyr_x_rad_s,gyr_y_rad_s,gyr_z_rad_s"
legible = st.builds(
    lambda body: "\n".join([LEGIBLE, *(",".join(map(str, row)) for row in body)]),
    st.lists(
        st.tuples(st.floats(-1e12, 1e12), *[st.floats(-20, 20)] * 3, *[st.floats()] * 3),
        max_size=8,
    ),
)


def read(path: Path) -> Recording | str:
    """Return the recording, or what is said of it."""
    try:
        return read_vendor_csv(path)
    except SourceError as refused:
        return str(refused)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.one_of(st.binary(max_size=200), tables.map(str.encode), legible.map(str.encode)))
def test_garbage_is_refused_by_name_or_read_whole(tmp_path: Path, raw: bytes) -> None:
    path = tmp_path / "garbage.csv"
    path.write_bytes(raw)
    found = read(path)
    if isinstance(found, str):
        assert str(path) in found
    else:
        assert len(found) == len(list(found)) >= 1
        assert found.force_m_s2.shape == found.rate_rad_s.shape == (len(found), 3)


@pytest.mark.parametrize("keep", [0.2, 0.5, 0.9, 0.99])
def test_a_file_cut_off_is_read_or_refused(tmp_path: Path, keep: float) -> None:
    body = "\n".join(f"{k / 100:.3f},0,0,-9.81,0,0,0.{k}" for k in range(100))
    whole = f"{LEGIBLE}\n{body}\n".encode()
    path = tmp_path / "cut.csv"
    path.write_bytes(whole[: int(keep * len(whole))])
    found = read(path)
    if isinstance(found, str):
        assert "line" in found
    else:
        assert np.all(np.diff(found.time_ns) == 10_000_000)
