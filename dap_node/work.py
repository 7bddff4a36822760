"""What a DAP is told to do, in plain words: who it is, whom it links to, and what it hears by.

The command line is made into this, and may be handed on to another process as JSON.
"""

from __future__ import annotations

from pathlib import Path

import msgspec

from dap_node.lean import doing_without
from dap_node.scanners.accelerometer import IioAccelerometer
from dap_node.scanners.observation import Motion
from dap_node.scanners.opening import PLAYED, Playable, open_played
from dap_node.settings import DapSettings
from shared.config import load_toml
from shared.journal_place import journal_path
from shared.messages import StationTable
from shared.radios.live import LiveSource
from shared.radios.opening import open_radios
from shared.radios.readings import RadioScan
from shared.security.bundle import Bundle
from shared.security.certificates import Identity
from shared.security.opening import local_endpoint, open_keys
from shared.stations import read_stations
from shared.topics import check_id


class Work(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The options of ``dap-node run``, which has the words for each."""

    dap_id: str
    incident: str
    connect: tuple[str, ...]
    listen: str | None
    keys: Path | None
    insecure: bool
    journal: Path | None
    source: tuple[str, ...]
    scan_rate: float
    stations: Path | None
    config: Path | None
    seed: int
    accelerometer: str | None
    speed: float
    by_itself: bool
    await_start: bool
    with_parent: bool

    @classmethod
    def of_json(cls, text: str) -> Work:
        """Read an object that has a key for each. Raises ``ValueError`` for anything else."""
        return msgspec.json.decode(text, type=cls, dec_hook=lambda kind, value: kind(value))

    @property
    def identity(self) -> Identity:
        """Who it is. Raises ``ValueError`` for what is no id."""
        return Identity("dap", check_id(self.dap_id, "--id"))

    def open_keys(self) -> Bundle | None:
        """Return the DAP's keys, if it has some. Raises ``ValueError`` for what cannot be used."""
        check_id(self.incident, "--incident")
        return open_keys(self.keys, self.identity, insecure=self.insecure)

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

    def opened(self) -> Playable | list[LiveSource[RadioScan | Motion]]:
        """Return what is heard by; ``ValueError`` or ``OSError`` if it cannot be used."""
        names = self.source
        played = open_played(names[0], self.dap_id, self.seed) if len(names) == 1 else None
        if played is not None:
            return played
        # Bluetooth comes with asyncio, which would bring the system's OpenSSL.
        with doing_without("ssl"):
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
