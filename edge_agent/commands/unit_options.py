"""The options of ``edge-agent run``: whose unit it is, how it is worn, and what else they have."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter, validators

from edge_agent.commands.prepare import StepScale, Wheelbase
from edge_agent.mounts.methods import MethodName, MountName, Told, default_method
from edge_agent.mounts.vehicle import WHEELBASE_M
from shared.bus.zenoh_settings import check_dialled
from shared.config import ConfigError, checked
from shared.journal_place import journal_path
from shared.messages import LocalPosition
from shared.node_options import Insecure, JournalFile, Keys
from shared.security.bundle import Bundle
from shared.security.certificates import Identity
from shared.security.opening import local_endpoint, open_keys
from shared.topics import check_id


@Parameter(name="*")
@dataclass(frozen=True)
class UnitItself:
    """Whose unit it is, and whom it links to.

    Attributes
    ----------
    responder_id
        Name of the responder.
    incident
        Name of the incident.
    connect
        DAPs and posts to dial, one an option; the first that answers is kept to. By default
        port 7447 of this machine.
    keys
        Folder of this responder's keys: 'command-post keys issue' makes it.
    insecure
        Do without keys, on one machine: nothing is encrypted or authenticated.
    journal
        File that keeps what is said until the post has it; by default one of this responder's in
        the incident, among what programs keep for the user.
    post_id
        Whose orders are heeded. They are told on standard output; SIGUSR1 acknowledges them.

    """

    responder_id: Annotated[str, Parameter(name="--id")]
    incident: str = "incident"
    connect: Annotated[tuple[str, ...], Parameter(consume_multiple=False)] = ()
    keys: Keys = None
    insecure: Insecure = False
    journal: JournalFile = None
    post_id: Annotated[str, Parameter(name="--post")] = "post"

    @property
    def identity(self) -> Identity:
        """Who it is. Raises ``ValueError`` for what is no id."""
        return Identity("responder", check_id(self.responder_id, "--id"))

    def open_keys(self) -> Bundle | None:
        """Return the unit's keys, if it has some. Raises ``ValueError`` for what cannot be used."""
        check_id(self.incident, "--incident")
        check_id(self.post_id, "--post")
        return open_keys(self.keys, self.identity, insecure=self.insecure)

    def dialled(self, bundle: Bundle | None) -> tuple[str, ...]:
        """Return whom it dials. Raises ``ValueError`` for what cannot be dialled."""
        for endpoint in self.connect:
            check_dialled(endpoint, bundle)
        return self.connect or (local_endpoint(bundle),)

    @property
    def journal_file(self) -> Path:
        """The file that keeps what is said."""
        return journal_path(self.journal, self.incident, "responder", self.responder_id)


@Parameter(name="*")
@dataclass(frozen=True)
class Worn:
    """How the sensor is worn and read, and what is told of wearer, vehicle and building.

    Attributes
    ----------
    mount
        How the sensor is worn: on a boot, at the chest or in the hand, on the belt, in a vehicle.
    method
        How it is read: eskf or linear for a boot, robust or published for the others. The first
        is the default.
    driven_speed
        How fast the vehicle goes at the first sample (m/s), where that is known: by the satellites
        in front of the car park, for one. A start from rest is seen; any other speed is sought.
    wheelbase
        Metres between the vehicle's axles: an engine has 3.5 to 5.
    step_scale
        How long the steps of who wears a chest's or a waist's sensor are, in those of nobody in
        particular: 'edge-agent pace' tells it.
    dominant_direction
        Hold the heading to where the building's corridors lead, which is learnt on the way.

    """

    mount: MountName = "boot"
    method: MethodName | None = None
    driven_speed: Annotated[float | None, Parameter(validator=validators.Number(lte=75.0))] = None
    wheelbase: Wheelbase = WHEELBASE_M
    step_scale: StepScale = 1.0
    dominant_direction: Annotated[bool, Parameter(negative="")] = False

    @property
    def chosen_method(self) -> MethodName:
        """How the sensor is read."""
        return self.method or default_method(self.mount)

    @property
    def told(self) -> Told:
        """What is told of building, vehicle and wearer."""
        return Told(self.dominant_direction, self.wheelbase, self.step_scale)


@Parameter(name="*")
@dataclass(frozen=True)
class Beginning:
    """Where the wearer stands at first.

    Attributes
    ----------
    start
        Where the wearer stands at first: metres north, east and down of the incident's origin.
    stands_at
        A known point where the wearer reports to stand at first: NORTH,EAST or NORTH,EAST,DOWN.
    stands_at_sd
        How near it, in metres (standard deviation in each direction).

    """

    start: tuple[float, float, float] | None = None
    stands_at: str | None = None
    stands_at_sd: Annotated[float, Parameter(validator=validators.Number(gt=0.0, lte=1e3))] = 1.0

    @property
    def place(self) -> LocalPosition | None:
        """Where that is held to be. Raises ``ConfigError`` for what is no place."""
        if self.start is None:
            return None
        north_m, east_m, down_m = self.start
        place = LocalPosition(
            north_m=north_m, east_m=east_m, down_m=down_m, covariance_m2=(1.0, 0.0, 1.0)
        )
        return _checked_place(place, "--start")

    @property
    def known_point(self) -> LocalPosition | None:
        """The point that is reported. Raises ``ValueError`` for what is none."""
        return None if self.stands_at is None else _known_point(self.stands_at, self.stands_at_sd)


@Parameter(name="*")
@dataclass(frozen=True)
class Devices:
    """What else the wearer has.

    Attributes
    ----------
    daps
        How many DAPs the wearer carries in: they are told when to set the next one down.
    radio
        The unit's own radio, that hears DAPs and other units: wpa:SOCKET, nl80211:INTERFACE or
        ble:ADAPTER, as many as there are, one an option. Posts tell whose radios are whose.
    radio_offset
        Decibels added to what it hears, which bring a DAP at a clear metre to -40 dBm.
    button
        The mayday button: an input device of Linux, as /dev/input/event3. Held for a second it
        calls, held for three it takes the call back. 'edge-agent mayday' does without one.
    supplies
        JSON file that tells what is left, besides this machine's own battery (docs/alarms.md).

    """

    daps: Annotated[int, Parameter(validator=validators.Number(gte=0, lte=1000))] = 0
    radio: Annotated[tuple[str, ...], Parameter(consume_multiple=False)] = ()
    radio_offset: Annotated[float, Parameter(validator=validators.Number(gte=-60, lte=60))] = 0.0
    button: Path | None = None
    supplies: Path | None = None


def _known_point(text: str, sd_m: float) -> LocalPosition:
    """Return the point that ``--stands-at`` gives; ``ValueError`` if it gives none."""
    try:
        north_m, east_m, down_m = (*map(float, text.split(",")), 0.0)[:3]
        if text.count(",") > 2:
            raise ValueError
    except ValueError:
        raise ValueError(
            f"--stands-at {text!r}: write metres as NORTH,EAST or NORTH,EAST,DOWN"
        ) from None
    covariance_m2 = (sd_m**2, 0.0, sd_m**2)
    point = LocalPosition(
        north_m=north_m, east_m=east_m, down_m=down_m, covariance_m2=covariance_m2
    )
    return _checked_place(point, f"--stands-at {text!r}")


def _checked_place(place: LocalPosition, option: str) -> LocalPosition:
    """Return a place that ``option`` gives. Raises ``ConfigError``, which names it."""
    try:
        return checked(place)
    except ConfigError as error:
        raise ConfigError(f"{option}: {error}") from None
