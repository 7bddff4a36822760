"""A program on a machine whose clock is set while it runs.

``python -m tests.faults.set_clock FILE MODULE ARGS`` runs a module whose clock is ahead by as many
seconds as ``FILE`` says at each moment. Where there is libfaketime, ``clock_set_by`` has that do it
instead: so what is not Python sees it as well.
"""

from __future__ import annotations

import runpy
import sys
import time
from pathlib import Path

from tests.faults.fleet import Program

LIBRARIES = ("faketime/libfaketimeMT.so.1", "*/faketime/libfaketimeMT.so.1")


def clock_set_by(file: Path, program: Program) -> Program:
    """Return ``program`` on a machine whose clock ``set_clock`` sets by ``file``."""
    set_clock(file, 0.0)
    library = next((found for each in LIBRARIES for found in Path("/usr/lib").glob(each)), None)
    if library is None:
        arguments = (str(file), program.module, *program.arguments)
        return program._replace(module="tests.faults.set_clock", arguments=arguments)
    environment = {
        "LD_PRELOAD": str(library), "FAKETIME_TIMESTAMP_FILE": str(file), "FAKETIME_NO_CACHE": "1",
        "FAKETIME_DONT_FAKE_MONOTONIC": "1", "NO_FAKE_STAT": "1",
    }  # fmt: skip
    return program._replace(environment={**program.environment, **environment})


def set_clock(file: Path, ahead_s: float) -> None:
    """Set the clock that goes by ``file``, to be ahead of the machine's by so much."""
    being_written = file.with_name(f"{file.name}.new")
    being_written.write_text(f"{ahead_s:+.0f}")
    being_written.replace(file)


def main(file: str, module: str) -> None:
    """Run a module by that clock."""
    really, really_ns = time.time, time.time_ns

    def ahead_s() -> float:
        return float(Path(file).read_text())

    # Modules take these as they are imported.
    time.time = lambda: really() + ahead_s()
    time.time_ns = lambda: really_ns() + round(ahead_s() * 1e9)
    runpy.run_module(module, run_name="__main__", alter_sys=True)


if __name__ == "__main__":
    _, _file, _module, *_arguments = sys.argv
    sys.argv = [_module, *_arguments]
    main(_file, _module)
