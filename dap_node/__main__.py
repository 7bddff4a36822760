"""``dap-node``: arguments and wiring."""

from __future__ import annotations

from cyclopts import App

from dap_node.commands.evaluate import evaluate
from dap_node.commands.serve import rehearse, run
from shared.command_line import run_command_line

app = App(
    name="dap-node",
    help="""Tell who is near, from where it was set down, and relay for those who go further in.

    Example: dap-node evaluate four_daps --seeds 0-4
    """,
    version_flags=["--version"],
)
app.command(run)
app.command(rehearse)
app.command(evaluate)


def main() -> None:
    """Run the command line of this process, and exit with what its command returns."""
    run_command_line(app)


if __name__ == "__main__":
    main()
