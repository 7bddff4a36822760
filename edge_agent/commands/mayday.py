"""``edge-agent mayday``: call for help by the agent that runs on this unit."""

from __future__ import annotations

import socket
from typing import Annotated

import structlog
from cyclopts import Parameter, validators
from rich.console import Console

from edge_agent.mayday_controls import socket_path
from shared.journal_place import journal_path
from shared.node_options import JournalFile
from shared.process import ExitCode
from shared.topics import check_id

AGENT_S = 5.0
"""An agent that is there says so within this."""

_log = structlog.stdlib.get_logger(__name__)


def mayday(
    *,
    responder_id: Annotated[str, Parameter(name="--id")],
    cancel: Annotated[bool, Parameter(negative="")] = False,
    incident: str = "incident",
    journal: JournalFile = None,
    wait: Annotated[float, Parameter(validator=validators.Number(gte=0.0, lte=3600.0))] = 10.0,
) -> int:
    """Call for help, or take it back, by the agent that runs on this unit; say whether it is heard.

    The agent has it in its journal and says it until the post has answered, whether there is a link
    now or not. Example: edge-agent mayday --id r1

    Exits with 0 once the post has heard it, with 1 if it has not within --wait seconds (the agent
    goes on saying it) or if no agent runs here.

    Parameters
    ----------
    responder_id
        Name of the responder.
    cancel
        Take the call back.
    incident
        Name of the incident.
    journal
        The agent's journal, if it was given one.
    wait
        How many seconds to wait for the post's answer.

    """
    try:
        check_id(incident, "--incident")
        check_id(responder_id, "--id")
    except ValueError as error:
        _log.error(str(error))
        return ExitCode.USAGE
    path = socket_path(journal_path(journal, incident, "responder", responder_id))
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as agent:
        try:
            agent.connect(str(path))
            agent.settimeout(AGENT_S)
            agent.sendall(b"cancel" if cancel else b"call")
            return _follow(agent, wait)
        except OSError as error:
            why = error.strerror or str(error)
            _log.error(
                f"no agent of {responder_id} answers here ({why}); does it run on this unit?"
            )
            return ExitCode.FAILURE


def _follow(agent: socket.socket, wait_s: float) -> int:
    """Tell what the agent says until the post has heard it. Raises ``OSError`` without an agent."""
    lines = agent.makefile(encoding="utf-8")
    first = lines.readline().strip()
    if not first:
        raise OSError("it does not take the call")
    _print(first)
    if first == "NOT CALLED":
        return ExitCode.OK
    agent.settimeout(wait_s or None)
    try:
        said = lines.readline().strip() if wait_s else ""
    except TimeoutError:
        said = ""
    if not said:
        _log.warning("not heard so far: the agent goes on saying it")
        return ExitCode.FAILURE
    _print(said)
    return ExitCode.OK


def _print(words: str) -> None:
    Console().print(f"MAYDAY {words}", highlight=False, markup=False, soft_wrap=True)
