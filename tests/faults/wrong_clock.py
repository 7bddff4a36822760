"""An agent on a machine whose clock is wrong: ``python -m tests.faults.wrong_clock SECONDS ARGS``.

The clock is ``SECONDS`` ahead when the program begins, and set right two seconds later.
"""

from __future__ import annotations

import sys
import time

AHEAD_S = float(sys.argv.pop(1))
SET_RIGHT_S = 2.0

_really_ns = time.time_ns
_begun_s = time.monotonic()


def _wrong_ns() -> int:
    is_wrong = time.monotonic() - _begun_s < SET_RIGHT_S
    return _really_ns() + (round(AHEAD_S * 1e9) if is_wrong else 0)


time.time_ns = _wrong_ns

from edge_agent.__main__ import main  # noqa: E402  the clock is to be wrong before

main()
