"""``command-post``: arguments and wiring."""

from __future__ import annotations

from cyclopts import App

from command_post.commands.afterwards import afterwards
from command_post.commands.doctor import doctor
from command_post.commands.keys import keys
from command_post.commands.live import demo, run
from command_post.commands.offline import montecarlo, plan, rehearse
from command_post.commands.orders import click, floor, order, set_down
from command_post.commands.people import people
from command_post.commands.prepare import prepare
from command_post.commands.proof import proof
from command_post.commands.recordings import salvage_file, verify
from command_post.commands.scoring import replay, score_file
from shared.command_line import run_command_line

app = App(
    name="command-post",
    help="""Know where everybody is: hear them, fuse what they say, record it, replay it.

    Example: command-post demo --speed 10
    """,
    version_flags=["--version"],
)
app.command(run)
app.command(demo)
app.command(click)
app.command(floor)
app.command(order)
app.command(set_down)
app.command(replay)
app.command(score_file, name="score")
app.command(afterwards)
app.command(rehearse)
app.command(montecarlo)
app.command(plan)
app.command(proof)
app.command(verify)
app.command(salvage_file, name="salvage")
app.command(prepare)
app.command(doctor)
app.command(keys)
app.command(people)


def main() -> None:
    """Run the command line of this process, and exit with what its command returns."""
    run_command_line(app)


if __name__ == "__main__":
    main()
