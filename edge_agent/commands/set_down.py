"""``edge-agent set-down``: a responder tells a DAP that they have just set it down."""

from __future__ import annotations

import time
from typing import Annotated

import structlog
from cyclopts import Parameter

from shared.bus.zenoh_bus import open_zenoh
from shared.introductions import Introductions
from shared.messages import SetDownHere
from shared.node_options import Insecure, Keys
from shared.process import ExitCode
from shared.security.certificates import Identity
from shared.security.opening import local_endpoint, open_keys
from shared.sender import Sender, Unkept
from shared.topics import check_id

CONNECT_S = 5.0
POLL_S = 0.05
TIMES, PERIOD_S = 5, 0.5
"""It is said so often: the DAP may have to ask first who says it, and does not answer."""

_log = structlog.stdlib.get_logger(__name__)


def set_down(
    *,
    responder_id: Annotated[str, Parameter(name="--id")],
    dap: str,
    incident: str = "incident",
    connect: Annotated[tuple[str, ...], Parameter(consume_multiple=False)] = (),
    keys: Keys = None,
    insecure: Insecure = False,
) -> int:
    """Tell a DAP that the responder has just set it down: it stands where they stand.

    Example: edge-agent set-down --id r1 --dap dap2 --keys keys/r1 --connect tls/192.168.7.11:7447

    Parameters
    ----------
    responder_id
        Name of the responder.
    dap
        Which DAP.
    incident
        Name of the incident.
    connect
        DAPs and posts to dial, one an option. By default port 7447 of this machine.
    keys
        Folder of this responder's keys: 'command-post keys issue' makes it.
    insecure
        Do without keys, on one machine: nothing is encrypted or authenticated.

    """
    try:
        for node_id, option in ((incident, "--incident"), (responder_id, "--id"), (dap, "--dap")):
            check_id(node_id, option)
        bundle = open_keys(keys, Identity("responder", responder_id), insecure=insecure)
        with (
            open_zenoh("client", connect or (local_endpoint(bundle),), bundle=bundle) as bus,
            Introductions(bus, incident, bundle),
        ):
            give_up_s = time.monotonic() + CONNECT_S
            while not bus.connected():
                if time.monotonic() >= give_up_s:
                    _log.error("no DAP and no post is in reach; see --connect")
                    return ExitCode.FAILURE
                time.sleep(POLL_S)
            outbox = Unkept(None if bundle is None else bundle.sign)
            sender = Sender(bus, incident, "responder", responder_id, outbox)
            told = SetDownHere(event_time_ns=time.time_ns(), sequence=0, dap_id=dap, position=None)
            for _ in range(TIMES):
                sender.send(told)
                time.sleep(PERIOD_S)
    except ValueError as error:
        _log.error(str(error))
        return ExitCode.USAGE
    return ExitCode.OK
