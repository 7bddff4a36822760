"""Recordings of a beacon carried by fixed receivers, with the truth: ``rssi_walkby`` (docs).

Every receiver stands for a DAP, and the beacon for a responder. The beacon's power is unknown, so
that readings are brought to the product's scale by those taken beside the receivers.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from shared.npz_file import NpzFileError, array_of, load_npz

Array: TypeAlias = NDArray[np.float64]

BESIDE_M = 2.0
"""Readings from within this say how strong the beacon is."""

CLOSE_M, LEAST_SPAN_M = 8.0, 1.0
"""Where there are none, those from within this do, by how power falls off there."""

NOMINAL_AT_1_M_DBM = -40.0
NOMINAL_EXPONENT = 2.2
"""What the product's scale takes a radio to be like near by."""

LEAST_DBM, MOST_DBM = -200.0, 100.0

_NEEDED = ("t_s", "receiver", "rssi_dbm", "receiver_xyz_m", "truth_xyz_m")


class WalkBy(NamedTuple):
    """One recording: ``n`` readings in the order of time, of ``m`` receivers.

    ``time_s`` (n,) counts from the first; ``receiver`` (n,) are rows of ``receiver_m`` (m, 3),
    ``beacon_m`` (n, 3) is where the beacon was, both in one frame with its third axis up.
    """

    time_s: Array
    receiver: NDArray[np.int64]
    rssi_dbm: Array
    receiver_m: Array
    beacon_m: Array

    @property
    def slant_m(self) -> Array:
        """How far from its receiver the beacon was at each reading (n,), height included."""
        return np.asarray(np.linalg.norm(self.beacon_m - self.receiver_m[self.receiver], axis=1))


def read_walk_by(path: Path) -> WalkBy:
    """Return the recording at ``path``; raise ``NpzFileError`` if it is not a whole one."""
    arrays = load_npz(path)
    missing = [name for name in _NEEDED if name not in arrays]
    if missing:
        raise NpzFileError(
            f"{path}: no array {', '.join(missing)}; it has {', '.join(sorted(arrays)) or 'none'}. "
            f"A walk past receivers needs {', '.join(_NEEDED)}"
        )
    count, receivers = arrays["t_s"].size, len(np.atleast_1d(arrays["receiver_xyz_m"]))
    shapes = {"t_s": (count,), "receiver": (count,), "rssi_dbm": (count,),
              "receiver_xyz_m": (receivers, 3), "truth_xyz_m": (count, 3)}  # fmt: skip
    for name, shape in shapes.items():
        if not np.isfinite(array_of(path, arrays, name, shape)).all():
            raise NpzFileError(f"{path}: {name} holds what is no number; export it again")
    receiver = arrays["receiver"].astype(np.int64)
    if count < 2 or receiver.min() < 0 or receiver.max() >= receivers:
        raise NpzFileError(f"{path}: receiver points outside receiver_xyz_m; export it again")
    order = np.argsort(arrays["t_s"], kind="stable")
    time_s = arrays["t_s"][order]
    if not 0.0 < time_s[-1] - time_s[0] < 1e6:
        raise NpzFileError(f"{path}: t_s spans {time_s[-1] - time_s[0]:.0f} s; give seconds")
    if arrays["rssi_dbm"].min() < LEAST_DBM or arrays["rssi_dbm"].max() > MOST_DBM:
        raise NpzFileError(f"{path}: rssi_dbm holds what no radio reads; give dBm")
    return WalkBy(
        time_s - time_s[0],
        receiver[order],
        arrays["rssi_dbm"][order],
        arrays["receiver_xyz_m"],
        arrays["truth_xyz_m"][order],
    )


def calibration_db(recordings: list[WalkBy]) -> float:
    """Return what brings the beacon to the product's scale: see ``offset_beside``."""
    slant_m = np.concatenate([one.slant_m for one in recordings])
    return offset_beside(slant_m, np.concatenate([one.rssi_dbm for one in recordings]))


def offset_beside(range_m: Array, rssi_dbm: Array) -> float:
    """Return what is to be added to readings (n,) to bring their radio to the product's scale.

    It is the median of what those near by lack of the nominal power, as of a DAP whose installer
    stands beside it; of a walk that came by farther off, what the line through the closest lacks
    at that range. Raises ``ValueError`` where nothing was close.
    """
    beside = range_m < BESIDE_M
    if beside.any():
        nominal_dbm = NOMINAL_AT_1_M_DBM - 10.0 * NOMINAL_EXPONENT * np.log10(range_m[beside])
        return float(np.median(nominal_dbm - rssi_dbm[beside]))
    close = range_m < CLOSE_M
    if not close.any() or np.ptp(range_m[close]) < LEAST_SPAN_M:
        raise ValueError(f"no reading within {BESIDE_M:g} m to calibrate by; give --config")
    per_decade_db, at_1_m_dbm = np.polyfit(np.log10(range_m[close]), rssi_dbm[close], 1)
    decades = np.log10(BESIDE_M)
    nominal_dbm = NOMINAL_AT_1_M_DBM - 10.0 * NOMINAL_EXPONENT * decades
    return float(nominal_dbm - (at_1_m_dbm + per_decade_db * decades))
