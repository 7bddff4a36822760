"""An agent on a machine whose clock is wrong: ``python -m tests.faults.wrong_clock SECONDS ARGS``.

The clock is ``SECONDS`` ahead when the program reads it first, and is set right at once.
"""

from __future__ import annotations

import sys
import time

AHEAD_S = float(sys.argv.pop(1))

_really_ns = time.time_ns
time.time_ns = lambda: _really_ns() + round(AHEAD_S * 1e9)

import shared.clock  # noqa: E402, F401  it reads the clock when it is imported

time.time_ns = _really_ns

from edge_agent.__main__ import main  # noqa: E402

main()
