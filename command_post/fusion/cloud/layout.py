"""How a cloud and what befalls it lie in flat arrays of single-precision numbers.

A cloud is one buffer of blocks; in a block stand 64 norths, then 64 easts, and so on. Sixty-four
lanes fill any vector register, and one buffer leaves the compiler no doubt about overlaps, for
which it would fall back to one number at a time.
"""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Lanes: TypeAlias = NDArray[np.float32]
Keys: TypeAlias = NDArray[np.uint32]
Counts: TypeAlias = NDArray[np.int64]
Indices: TypeAlias = NDArray[np.int32]
Sums: TypeAlias = NDArray[np.float64]

LANES, SUM_LANES = 64, 16
"""Sums are kept for every sixteenth lane, of which two or four vector registers hold one each."""
FIELDS = 9
NORTH, EAST, OFFSET, DRIFT, LOG_SCALE, WEIGHT, COSINE, SINE, SCALE = (
    LANES * field for field in range(FIELDS)
)
"""Where a field begins in its block: metres north and east of the cloud's origin, heading offset φ
of the agent's frame in (-π, π], its rate in rad/s, log-scale and weight. The last three, cos φ,
sin φ and the scale itself, follow from the others."""

BLOCK = FIELDS * LANES

MOST_AT_ONCE = 5
"""Of neighbouring ties of one exponent so many are weighed at once: the product of what they tell
cannot overflow for anyone within ten thousand standard deviations of each."""

(
    MOVE_NORTH, MOVE_EAST, MOVE_S,
    ROOT_NN, ROOT_EN, ROOT_EE, ROOT_HN, ROOT_HE, ROOT_HH, ROOT_JUMP,
    JUMP_BELOW, MISSED_FROM, DRIFT_WALK,
    RESAMPLE_BELOW, KEPT_SPREAD, STEP_WIDTH,
) = range(16)  # fmt: skip
"""Columns of a step: displacement in the agent's frame (m) and its duration (s, negative for none);
the lower Cholesky root of its noise in north, east and heading, and what stands for the last where
the heading jumps; of 65536 chances, those below the one jump and those from the other on hide a
missed stride; noise of the drift; the effective count below which the cloud is resampled, and how
much of the spread of drift and scale copies keep."""

(
    TIE_NORTH, TIE_EAST, SINCE_NORTH, SINCE_EAST, TIE_NN, TIE_NE, TIE_EE, TIE_EXPONENT, TIE_AREA,
    TIE_WIDTH,
) = range(10)  # fmt: skip
"""Columns of a tie: the place (m from the cloud's origin), the agent's displacement since, the
inverse covariance over the degrees of freedom (nn, twice ne, ee), the exponent and the square root
of the covariance's determinant, 2π times (m²)."""

(
    MEAN_NORTH, MEAN_EAST, VAR_NN, VAR_NE, VAR_EE, MEAN_OFFSET, OFFSET_SD, EFFECTIVE,
    LOG_EVIDENCE, RESAMPLED, SUMMARY_WIDTH,
) = range(11)  # fmt: skip
"""Columns of a summary, after the ties of a step and before its resampling."""

COMPONENT_WEIGHT, COMPONENT_MEAN, COMPONENT_ROOT, COMPONENT_TURNED, COMPONENT_WIDTH = (
    0, 1, 6, 21, 22,
)  # fmt: skip
"""Where in a component of a mixture begin: its weight and those before it, the mean of (north,
east, φ, log-scale, drift), the rows of the lower Cholesky root of its covariance; and whether φ may
be anything."""
