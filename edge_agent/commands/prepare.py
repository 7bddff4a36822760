"""``edge-agent prepare``: what the first start would wait for, done ahead."""

from __future__ import annotations

from typing import Annotated

from cyclopts import Parameter

from edge_agent.mounts.methods import DEFAULT_METHOD, MethodName, make_mount
from shared.process import ExitCode, end_with_parent


def prepare(
    *,
    method: MethodName = DEFAULT_METHOD,
    with_parent: Annotated[bool, Parameter(show=False)] = False,
) -> int:
    """Build the machine code of a boot method, once for all agents on this machine.

    Takes some twenty seconds after an installation, and one second from then on; an agent that
    starts without it does the same first. Example: edge-agent prepare

    Parameters
    ----------
    method
        How the boot's sensor is read.
    with_parent
        End when standard input closes.

    """
    if with_parent:
        end_with_parent()
    make_mount("boot", method)
    return ExitCode.OK
