"""The options of ``dap-node run``: who the DAP is, whom it links to, and what it hears by."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter, validators

from dap_node.scanners.accelerometer import IioAccelerometer
from dap_node.scanners.observation import Motion
from dap_node.scanners.opening import PLAYED, Playable, open_played
from dap_node.settings import DapSettings
from shared.config import load_toml
from shared.journal_place import JournalFile, journal_path
from shared.messages import NodeId, StationTable
from shared.radios.live import SCAN_RATE_HZ, LiveSource
from shared.radios.opening import open_radios
from shared.radios.readings import RadioScan
from shared.security.bundle import Bundle
from shared.security.certificates import Identity
from shared.security.opening import Insecure, Keys, local_endpoint, open_keys
from shared.stations import read_stations
from shared.topics import Role, check_id


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

    def open_keys(self) -> Bundle | None:
        """Return the DAP's keys, if it has some. Raises ``ValueError`` for what cannot be used."""
        check_id(self.incident, "--incident")
        identity = Identity("dap", check_id(self.dap_id, "--id"))
        return open_keys(self.keys, identity, insecure=self.insecure)

    def dialled(self, bundle: Bundle | None) -> tuple[str, ...]:
        """Return whom it dials."""
        return self.connect or (local_endpoint(bundle),)

    def endpoints(self, bundle: Bundle | None) -> list[str]:
        """Return where it listens."""
        return [self.listen or local_endpoint(bundle, port=0)]

    @property
    def journal_file(self) -> Path:
        """The file that keeps what is said."""
        return journal_path(self.journal, self.incident, "dap", self.dap_id)


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
    seed: Annotated[int, Parameter(validator=validators.Number(gte=0))] = 1
    accelerometer: str | None = None

    def opened(self, dap_id: NodeId) -> Playable | list[LiveSource[RadioScan | Motion]]:
        """Return what is heard by; ``ValueError`` or ``OSError`` if it cannot be used."""
        names = self.source
        played = open_played(names[0], dap_id, self.seed) if len(names) == 1 else None
        if played is not None:
            return played
        live: list[LiveSource[RadioScan | Motion]] = [
            *open_radios(names, "--source", PLAYED, self.scan_rate)
        ]
        if self.accelerometer is not None:
            live.append(IioAccelerometer(self.accelerometer))
        return live

    def settings(self) -> DapSettings:
        """Return how it is made out who is near. Raises ``ConfigError`` if unreadable."""
        return load_toml(self.config, DapSettings) if self.config else DapSettings()

    def station_table(self) -> StationTable | None:
        """Return whose radio is whose, if that is told. Raises ``ConfigError`` if unreadable."""
        return None if self.stations is None else read_stations(self.stations)


def roles_of(bundle: Bundle | None) -> Callable[[str], Role]:
    """Return who tells a named node's role; of whom nobody has heard it is a responder's."""
    roles: dict[str, Role] = {}
    if bundle is not None:
        roles = {each.id: each.role for each in bundle.nodes.nodes}
    return lambda node_id: roles.get(node_id, "responder")
