"""The options of ``dap-node run``: who the DAP is, whom it links to, and what it hears by."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter, validators

from shared.node_options import Insecure, JournalFile, Keys, Seed
from shared.radios.live import SCAN_RATE_HZ


@Parameter(name="*")
@dataclass(frozen=True)
class DapItself:
    """Who the DAP is, and whom it links to.

    Attributes
    ----------
    dap_id
        Name of the DAP.
    incident
        Name of the incident.
    connect
        Posts and DAPs to dial, one an option; the links to all are kept up. By default port 7447
        of this machine.
    listen
        Where agents and other DAPs find this one; by default a free port of this machine.
    keys
        Folder of this DAP's keys: 'command-post keys issue' makes it.
    insecure
        Do without keys, on one machine: nothing is encrypted or authenticated.
    journal
        File that keeps what is said until the post has it; by default one of this DAP's in the
        incident, among what programs keep for the user.

    """

    dap_id: Annotated[str, Parameter(name="--id")]
    incident: str = "incident"
    connect: Annotated[tuple[str, ...], Parameter(consume_multiple=False)] = ()
    listen: str | None = None
    keys: Keys = None
    insecure: Insecure = False
    journal: JournalFile = None


@Parameter(name="*")
@dataclass(frozen=True)
class Hearing:
    """What the DAP hears by.

    Attributes
    ----------
    source
        Where signal strengths come from: nl80211:INTERFACE, hostapd:SOCKET, ble:ADAPTER (of
        these as many as there are, one an option), recorded:FILE or simulated:SCENARIO.
    scan_rate
        How many times a second a Wi-Fi radio is asked.
    stations
        Whose radio is whose, in TOML or CSV, until a post tells; by default what one told last.
    config
        TOML file with offset_db, [proximity] and [peaks] for another radio than the usual.
    seed
        Of a simulated source.
    accelerometer
        The box's own, iio:NUMBER of Linux: it tells when the DAP is set down, and taken up.

    """

    source: Annotated[tuple[str, ...], Parameter(consume_multiple=False)]
    scan_rate: Annotated[float, Parameter(validator=validators.Number(gt=0.0, lte=50.0))] = (
        SCAN_RATE_HZ
    )
    stations: Path | None = None
    config: Path | None = None
    seed: Seed = 1
    accelerometer: str | None = None
