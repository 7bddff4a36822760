"""How every program runs its command line."""

from __future__ import annotations

import sys

from cyclopts import App, CycloptsError

from shared.process import ExitCode, configure_logging, interrupt_on_signals


def run_command_line(app: App) -> None:
    """Run ``app`` on this process's arguments and exit with what its command returns.

    A mistake in the arguments is told by ``app`` and exits with ``ExitCode.USAGE``. A signal that
    the command does not heed itself breaks it off, and exits with ``ExitCode.INTERRUPTED``.
    """
    configure_logging()
    interrupt_on_signals()
    try:
        code = app(sys.argv[1:], exit_on_error=False, result_action="return_value")
    except CycloptsError:
        sys.exit(ExitCode.USAGE)
    except KeyboardInterrupt:
        sys.exit(ExitCode.INTERRUPTED)
    sys.exit(code if isinstance(code, int) else ExitCode.OK)
