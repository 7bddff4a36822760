"""``edge-agent``: arguments and wiring."""

from __future__ import annotations

from cyclopts import App

from edge_agent.commands.evaluate import evaluate
from edge_agent.commands.follow import rehearse, run
from edge_agent.commands.prepare import prepare
from shared.command_line import run_command_line

app = App(
    name="edge-agent",
    help="Follow a responder by the sensor on their boot.",
    version_flags=["--version"],
)
app.command(run)
app.command(rehearse)
app.command(prepare)
app.command(evaluate)


def main() -> None:
    """Run the command line of this process, and exit with what its command returns."""
    run_command_line(app)


if __name__ == "__main__":
    main()
