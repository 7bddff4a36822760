"""``dap-node``: arguments and wiring.

A command's module is imported when it is run: a DAP at work has no room for what simulating takes.
"""

from __future__ import annotations

import signal
import sys

if __name__ == "__main__" or sys.argv[0].endswith("dap-node"):
    # Who breaks it off while it is being loaded is to see no traceback.
    signal.signal(signal.SIGINT, signal.SIG_DFL)

from cyclopts import App

import dap_node.lean  # noqa: F401
from shared.command_line import run_command_line

app = App(
    name="dap-node",
    help="""Tell who is near, from where it was set down, and relay for those who go further in.

    Example: dap-node evaluate four_daps --seeds 0-4
    """,
    version_flags=["--version"],
)
COMMANDS = {
    "run": "dap_node.commands.serve:run",
    "record": "dap_node.commands.record:record",
    "rehearse": "dap_node.commands.rehearse:rehearse",
    "evaluate": "dap_node.commands.evaluate:evaluate",
}
for name, where in COMMANDS.items():
    app.command(where, name=name)


def main() -> None:
    """Run the command line of this process, and exit with what its command returns."""
    run_command_line(app, COMMANDS)


if __name__ == "__main__":
    main()
