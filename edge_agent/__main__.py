"""``edge-agent``: arguments and wiring.

A command's module is imported when it is run: an agent starts without what scoring takes.
"""

from __future__ import annotations

from cyclopts import App

from shared.command_line import run_command_line

app = App(
    name="edge-agent",
    help="Follow a responder by the sensor on their boot.",
    version_flags=["--version"],
)
app.command("edge_agent.commands.follow:run")
app.command("edge_agent.commands.follow:rehearse")
app.command("edge_agent.commands.prepare:prepare")
app.command("edge_agent.commands.evaluate:evaluate")


def main() -> None:
    """Run the command line of this process, and exit with what its command returns."""
    run_command_line(app)


if __name__ == "__main__":
    main()
