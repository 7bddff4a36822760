"""``edge-agent``: arguments and wiring.

A command's module is imported when it is run: an agent starts without what scoring takes.
"""

from __future__ import annotations

import signal
import sys

if __name__ == "__main__" or sys.argv[0].endswith("edge-agent"):
    # Who breaks it off while it is being loaded is to see no traceback.
    signal.signal(signal.SIGINT, signal.SIG_DFL)

from cyclopts import App

from shared.command_line import run_command_line

COMMANDS = {
    "run": "edge_agent.commands.follow:run",
    "set-down": "edge_agent.commands.set_down:set_down",
    "mayday": "edge_agent.commands.mayday:mayday",
    "rehearse": "edge_agent.commands.rehearse:rehearse",
    "retrace": "edge_agent.commands.retrace:retrace",
    "prepare": "edge_agent.commands.prepare:prepare",
    "pace": "edge_agent.commands.pace:pace",
    "evaluate": "edge_agent.commands.evaluate:evaluate",
}

app = App(
    name="edge-agent",
    help="""Follow a responder by the sensor they wear.

    Example: edge-agent evaluate simulated:course
    """,
    version_flags=["--version"],
)
for name, where in COMMANDS.items():
    app.command(where, name=name)


def main() -> None:
    """Run the command line of this process, and exit with what its command returns."""
    run_command_line(app, COMMANDS)


if __name__ == "__main__":
    main()
