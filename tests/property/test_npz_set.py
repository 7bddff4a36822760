"""A damaged .npz is refused by name, wherever the damage is."""

from __future__ import annotations

from io import BytesIO
from pathlib import Path

import numpy as np
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from edge_agent.sources.npz_set import read_npz_set
from edge_agent.sources.recording import SourceError


def whole(compressed: bool) -> bytes:
    target, chance = BytesIO(), np.random.default_rng(0)
    (np.savez_compressed if compressed else np.savez)(
        target,
        t_s=np.arange(50) / 100.0,
        acc_m_s2=chance.normal(size=(50, 3)) - [0.0, 0.0, 9.8],
        gyr_rad_s=chance.normal(size=(50, 3)),
        truth_xyz_m=np.zeros((50, 3)),
    )
    return target.getvalue()


WHOLE = {compressed: whole(compressed) for compressed in (False, True)}
changes = st.lists(st.tuples(st.floats(0.0, 1.0), st.binary(min_size=1, max_size=8)), max_size=4)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.booleans(), changes, st.floats(0.0, 1.0))
def test_damage_is_refused_by_name_or_harmless(
    tmp_path: Path,
    compressed: bool,
    damage: list[tuple[float, bytes]],
    kept: float,
) -> None:
    raw = bytearray(WHOLE[compressed])
    for where, bytes_ in damage:
        at = int(where * len(raw))
        raw[at : at + len(bytes_)] = bytes_
    path = tmp_path / "damaged.npz"
    path.write_bytes(raw[: int(kept * len(raw)) if damage else None])
    said = ""
    try:
        assert len(read_npz_set(path).recording) == 50
    except SourceError as refused:
        said = str(refused)
    assert not said or str(path) in said
    assert damage or not said
