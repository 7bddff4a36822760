"""What a sensor on a synthetic boot records."""

from __future__ import annotations

import numpy as np

from edge_agent.sources.recording import Recording
from tests.synthetic_boot import SyntheticWalk


def recorded(walk: SyntheticWalk, rate_hz: float) -> Recording:
    """Return ``walk`` at ``rate_hz``, with the field where the walk has one."""
    samples = list(walk.samples(rate_hz))
    return Recording(
        np.array([sample.time_ns for sample in samples]),
        np.array([sample.force_m_s2 for sample in samples]),
        np.array([sample.rate_rad_s for sample in samples]),
        np.array([sample.field_ut for sample in samples]) if walk.field_ut else None,
    )
