"""Machine code, built before anybody is waited for."""

from __future__ import annotations

import os
import subprocess
import sys
from functools import cache

PROGRAMS = ("edge_agent", "command_post")
BUILT = "CLEW_TESTS_BUILT"
"""Set in the processes of a test run that has built it already."""


@cache
def build_machine_code() -> None:
    """Have agents and post built once: all at a time they would be at it for minutes."""
    if BUILT in os.environ:
        return
    building = [
        subprocess.Popen([sys.executable, "-m", program, "prepare"], stderr=subprocess.PIPE)
        for program in PROGRAMS
    ]
    said = [process.communicate()[1].decode() for process in building]
    assert [process.returncode for process in building] == [0, 0], said
    os.environ[BUILT] = "1"
