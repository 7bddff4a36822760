"""``edge-agent``: arguments and wiring.

A command's module is imported when it is run: an agent starts without what scoring takes.
"""

from __future__ import annotations

import sys
from pkgutil import resolve_name

from cyclopts import App

from shared.command_line import run_command_line

COMMANDS = {
    "run": "edge_agent.commands.follow:run",
    "rehearse": "edge_agent.commands.rehearse:rehearse",
    "retrace": "edge_agent.commands.retrace:retrace",
    "prepare": "edge_agent.commands.prepare:prepare",
    "evaluate": "edge_agent.commands.evaluate:evaluate",
}

app = App(
    name="edge-agent",
    help="""Follow a responder by the sensor on their boot.

    Example: edge-agent evaluate simulated:course
    """,
    version_flags=["--version"],
)
for name, where in COMMANDS.items():
    app.command(where, name=name)


def main() -> None:
    """Run the command line of this process, and exit with what its command returns."""
    if not any(argument in COMMANDS for argument in sys.argv[1:]):
        _tell_of_all()
    run_command_line(app)


def _tell_of_all() -> None:
    """Import every command, so that help without a command has each one's own words."""
    for name, where in COMMANDS.items():
        del app[name]
        app.command(resolve_name(where), name=name)


if __name__ == "__main__":
    main()
