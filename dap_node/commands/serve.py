"""``dap-node run``: from the command line to a DAP at work."""

from __future__ import annotations

import json
import os
import sys
from dataclasses import asdict
from typing import Annotated

from cyclopts import Parameter, validators

from dap_node.commands.dap_options import DapItself, Hearing
from shared.process import logging_options
from shared.radios.opening import is_radio

LEAN = "dap_node.lean_start"


def run(
    *,
    itself: DapItself,
    hearing: Hearing,
    speed: Annotated[float, Parameter(validator=validators.Number(gt=0.0, lte=1e4))] = 1.0,
    by_itself: bool = True,
    await_start: bool = False,
    with_parent: Annotated[bool, Parameter(show=False)] = False,
) -> int:
    """Say who is near this DAP and where it stands, and relay for others.

    Runs until SIGINT or SIGTERM, or until a simulated exercise is over and no responder is alive
    that it might relay for. Examples: dap-node run --id dap2 --source nl80211:wlan0
    --keys keys/dap2 --listen tls/0.0.0.0:7447 --connect tls/192.168.7.10:7447;
    dap-node run --id dap2 --source simulated:four_daps --insecure

    Parameters
    ----------
    itself
        Who the DAP is.
    hearing
        What it hears by.
    speed
        How many times as fast as real, of a source that is played.
    by_itself
        Of radios: notice that it was set down. SIGUSR1, what a button on the box is to send, says
        so as well: by who is heard loudest.
    await_start
        Begin with the exercise, at its speed.
    with_parent
        Stop when standard input closes.

    """
    options = asdict(itself) | asdict(hearing)
    options |= {"speed": speed, "by_itself": by_itself}
    options |= {"await_start": await_start, "with_parent": with_parent}
    told = json.dumps(options, default=str)
    if sys.platform != "win32" and all(map(is_radio, hearing.source)):
        # This process goes on as one that never had to read a command line: that is 3 MB less.
        words = [sys.executable, "-m", LEAN, told, *logging_options()]
        os.execv(sys.executable, words)  # noqa: S606
    # Here alone, for whoever becomes another process need not load it.
    from dap_node.at_work import work  # noqa: PLC0415
    from dap_node.work import Work  # noqa: PLC0415

    return work(Work.of_json(told))
