"""``edge-agent``: arguments and wiring."""

from __future__ import annotations

import sys

from cyclopts import App, CycloptsError

from edge_agent.commands.evaluate import evaluate
from shared.process import ExitCode, configure_logging

app = App(
    name="edge-agent",
    help="Follow a responder by the sensor on their boot.",
    version_flags=["--version"],
)
app.command(evaluate)


def main() -> None:
    """Run the command line of this process, and exit with what its command returns."""
    configure_logging()
    try:
        code = app(exit_on_error=False, result_action="return_value")
    except CycloptsError:
        sys.exit(ExitCode.USAGE)
    sys.exit(code if isinstance(code, int) else ExitCode.OK)


if __name__ == "__main__":
    main()
