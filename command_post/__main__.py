"""``command-post``: arguments and wiring."""

from __future__ import annotations

import signal
import sys

if __name__ == "__main__" or sys.argv[0].endswith("command-post"):
    # Who breaks it off while it is being loaded is to see no traceback.
    signal.signal(signal.SIGINT, signal.SIG_DFL)

from cyclopts import App

from shared.command_line import run_command_line

app = App(
    name="command-post",
    help="""Know where everybody is: hear them, fuse what they say, record it, replay it.

    Example: command-post demo --speed 5
    """,
    version_flags=["--version"],
)
COMMANDS = (
    "live:run",
    "demo:demo",
    "orders:click",
    "origin:origin",
    "orders:floor",
    "orders:order",
    "orders:set_down",
    "scoring:replay",
    "scoring:score_file",
    "afterwards:afterwards",
    "review:review",
    "export:export",
    "offline:rehearse",
    "offline:montecarlo",
    "offline:mishaps",
    "offline:plan",
    "proof:proof",
    "recordings:verify",
    "recordings:salvage_file",
    "prepare:prepare",
    "doctor:doctor",
    "keys:keys",
    "people:people",
)
"""Where each is. Its module is loaded once it is asked for: a killed post is to be back soon."""

for command in COMMANDS:
    name = command.partition(":")[2].removesuffix("_file").replace("_", "-")
    app.command(f"command_post.commands.{command}", name=name)


def main() -> None:
    """Run the command line of this process, and exit with what its command returns."""
    if sys.argv[1:] in ([], ["-h"], ["--help"]):
        # What each command is for stands in its own module.
        for each in app:
            app[each]
    run_command_line(app)


if __name__ == "__main__":
    main()
