"""Starts a DAP's work in a process that has loaded nothing else: ``dap-node run`` goes on as this.

What is imported first keeps what is imported then small.
"""

from __future__ import annotations

import sys
from typing import cast

import dap_node.lean  # noqa: F401
from dap_node.at_work import work
from dap_node.work import Work
from shared.process import ExitCode, LogLevel, configure_logging, interrupt_on_signals, leave


def main() -> None:
    """Do the work that the first argument tells; the others are of ``logging_options``."""
    told, level, form = sys.argv[1:]
    configure_logging(cast(LogLevel, level), json=form == "json")
    interrupt_on_signals()
    try:
        code = work(Work.of_json(told))
    except KeyboardInterrupt:
        code = ExitCode.INTERRUPTED
    leave(code)


if __name__ == "__main__":
    main()
