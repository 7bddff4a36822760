"""The options of ``command-post run``: who the post is, what it keeps, how it fuses, who is who."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter
from cyclopts.validators import Number

from command_post.fusion.settings import FusionSettings
from command_post.fusion.team.settings import TeamSettings
from command_post.fusion.time_line import TimeLineSettings
from command_post.nodes.teams import Teams
from command_post.plans.plan_file import with_usable_plan
from command_post.recorder.parts import Rotation
from shared.bus.zenoh_settings import check_endpoint
from shared.config import checked, load_toml
from shared.messages import StationTable
from shared.node_options import Insecure, Keys
from shared.security.bundle import Bundle
from shared.security.certificates import Identity
from shared.security.opening import local_endpoint, open_keys
from shared.stations import read_stations
from shared.topics import check_id
from shared.units import NS_PER_S


@Parameter(name="*")
@dataclass(frozen=True)
class PostItself:
    """Who the post is, and where it is found.

    Attributes
    ----------
    incident
        Name of the incident; nodes of others are not heard.
    post_id
        Name of this post.
    listen
        Where DAPs and agents find the post; by default port 7447 of this machine alone.
    keys
        Folder of the post's keys: 'command-post keys issue' makes it.
    insecure
        Do without keys, on one machine: nothing is encrypted or authenticated.

    """

    incident: str = "incident"
    post_id: Annotated[str, Parameter(name="--id")] = "post"
    listen: str | None = None
    keys: Keys = None
    insecure: Insecure = False

    def open_keys(self) -> Bundle | None:
        """Return the post's keys, if it has some. Raises ``ValueError`` for what cannot be used."""
        identity = Identity("post", check_id(self.post_id, "--id"))
        check_id(self.incident, "--incident")
        return open_keys(self.keys, identity, insecure=self.insecure)

    def endpoints(self, bundle: Bundle | None) -> list[str]:
        """Return where the post listens. Raises ``ValueError`` for where it cannot."""
        listen = local_endpoint(bundle) if self.listen is None else self.listen
        check_endpoint(listen, bundle)
        return [listen]


@Parameter(name="*")
@dataclass(frozen=True)
class Record:
    """Where the recording goes, and in what parts.

    Attributes
    ----------
    record
        Where the recording goes; its name must be free. After a kill or a power cut the same
        command goes on with what is unfinished there.
    rotate_mb
        A part of the recording has so many megabytes at most, about; NAME.part002.mcap follows.
    rotate_hours
        A part of the recording is of so many hours at most.

    """

    record: Path = Path("incident.mcap")
    rotate_mb: Annotated[float, Parameter(validator=Number(gt=0, lte=1e6))] = 256.0
    rotate_hours: Annotated[float, Parameter(validator=Number(gt=0, lte=1e4))] = 1.0

    @property
    def rotation(self) -> Rotation:
        """When a part ends."""
        return Rotation(round(self.rotate_mb * 1e6), round(self.rotate_hours * 3600 * NS_PER_S))

    @property
    def noted_clock(self) -> Path:
        """Where the post's clock is noted, to go on after a kill."""
        return self.record.with_name(f"{self.record.name}.clock")


@Parameter(name="*")
@dataclass(frozen=True)
class Fusing:
    """How what is heard is fused.

    Attributes
    ----------
    seed
        Of the particle filters' random numbers.
    particles
        For each responder.
    hold_s
        Seconds that events wait for earlier ones before they are fused; 0.1 if not given.
    horizon_min
        Minutes that ways are solved from at least; before that they stay as they were held to be.
    lateness_min
        Minutes after which what comes late is recorded, and not put on the map any more.
    plan
        The building's walls, in GeoJSON: tracks are held to the way they run where people go so.
        One that cannot be used is named, also in the roster, and gone on without.

    """

    seed: int = 1
    particles: int = 1000
    hold_s: Annotated[float | None, Parameter(name="--hold")] = None
    horizon_min: Annotated[float, Parameter(name="--horizon", validator=Number(gt=0))] = 40.0
    lateness_min: Annotated[float, Parameter(name="--lateness", validator=Number(gt=0))] = 60.0
    plan: Path | None = None

    def settings(self) -> tuple[FusionSettings, str | None]:
        """Return them as settings, and why the plan cannot be used, if so.

        Raises ``ConfigError`` for what is out of its range.
        """
        team = TeamSettings(horizon_s=60.0 * self.horizon_min, lateness_s=60.0 * self.lateness_min)
        fusion = FusionSettings(team=checked(team), seed=self.seed, particles=self.particles)
        return with_usable_plan(checked(fusion), self.plan)

    @property
    def time_line(self) -> TimeLineSettings:
        """How long events wait. Raises ``ConfigError`` for what is out of its range."""
        return checked(TimeLineSettings(hold_s=self.hold_s))


@Parameter(name="*")
@dataclass(frozen=True)
class WhoIsWho:
    """Whose radio is whose, and who goes with whom.

    Attributes
    ----------
    stations
        Whose radio is whose, in TOML or CSV: told to DAPs and responders' units (docs/dap.md).
    teams
        Who is of which team, in TOML: who leaves theirs is alerted to (docs/alarms.md).

    """

    stations: Path | None = None
    teams: Path | None = None

    def station_table(self) -> StationTable | None:
        """Return whose radio is whose, if that is told. Raises ``ConfigError`` if unreadable."""
        return None if self.stations is None else read_stations(self.stations)

    def crews(self) -> Teams:
        """Return who is of which team. Raises ``ConfigError`` if that cannot be read."""
        return Teams() if self.teams is None else load_toml(self.teams, Teams)
