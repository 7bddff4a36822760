"""What a row of the ring of samples holds, column by column.

Slot ``i`` of a ring lies at ``i & (length - 1)``; the length is a power of two.
"""

from __future__ import annotations

FORCE = 0
"""Specific force in sensor axes (3), m/s²."""

RATE = 3
"""Angular rate in sensor axes (3), rad/s."""

STEP = 6
"""Time since the sample before, s."""

BRIDGED = 7
"""1 where the row only holds the place of a missing sample, else 0."""

RESTORED = 8
"""What was added to each clipped axis of the angular rate (3), rad/s."""

DOUBT, RATE_DOUBT = 11, 12
"""How far a bridged row's specific force and angular rate are to be doubted, 0 to 2."""

SAMPLE_WIDTH = 13
