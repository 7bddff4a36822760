"""Where the incident's frame lies on the Earth (pure).

The frame is local north-east-down at an origin; its north may be off true north, where the axes
were taken from a building. The geodesy is PROJ's topocentric conversion on WGS 84.
"""

from __future__ import annotations

import math
import re
from functools import cached_property
from typing import Annotated, NamedTuple, TypeAlias, TypeVar

import msgspec
import numpy as np
from msgspec import Meta
from numpy.typing import NDArray
from pyproj import Transformer

from shared.messages import OriginSet, TimeNs

Floats: TypeAlias = NDArray[np.float64]
T = TypeVar("T", float, Floats)

_NUMBER = r"[+-]?\d+(?:\.\d*)?"
_ORIGIN = re.compile(
    rf"(?P<latitude>{_NUMBER}),(?P<longitude>{_NUMBER})"
    rf"(?:,(?P<height>{_NUMBER})(?:,(?P<bearing>{_NUMBER}))?)?"
)


class Geodetic(NamedTuple):
    """A place on the Earth: degrees north and east, metres above the WGS 84 ellipsoid."""

    latitude_deg: float
    longitude_deg: float
    height_m: float


class Origin(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, dict=True):
    """Where the incident's origin is, and how many degrees clockwise of true north its north is.

    ``height_m`` is above the ellipsoid.
    """

    latitude_deg: Annotated[float, Meta(ge=-90.0, le=90.0)]
    longitude_deg: Annotated[float, Meta(ge=-180.0, le=180.0)]
    height_m: Annotated[float, Meta(ge=-1e4, le=1e5)] = 0.0
    bearing_deg: Annotated[float, Meta(ge=-360.0, le=360.0)] = 0.0

    def geodetic(self, north_m: float, east_m: float, down_m: float) -> Geodetic:
        """Return where on the Earth a place of the incident's frame is."""
        north_m, east_m = self._turned(north_m, east_m, self.bearing_deg)
        longitude, latitude, height = self._to_earth.transform(
            east_m, north_m, -down_m, radians=False
        )
        return Geodetic(float(latitude), float(longitude), float(height))

    def all_geodetic(self, places_m: Floats) -> Floats:
        """Return where on the Earth places (n, 3: north, east, down) are.

        That is (n, 3): latitude and longitude in degrees, height in metres.
        """
        north_m, east_m = self._turned(places_m[:, 0], places_m[:, 1], self.bearing_deg)
        longitude, latitude, height = self._to_earth.transform(
            east_m, north_m, -places_m[:, 2], radians=False
        )
        return np.column_stack([latitude, longitude, height])

    def local(self, place: Geodetic) -> tuple[float, float, float]:
        """Return a place on the Earth in the incident's frame: north, east, down (m)."""
        east_m, north_m, up_m = self._to_earth.transform(
            place.longitude_deg, place.latitude_deg, place.height_m,
            radians=False, direction="INVERSE",
        )  # fmt: skip
        north_m, east_m = self._turned(float(north_m), float(east_m), -self.bearing_deg)
        return north_m, east_m, -float(up_m)

    @classmethod
    def through(cls, place: Geodetic, bearing_deg: float, local_m: tuple[float, float]) -> Origin:
        """Return the origin by which ``local_m`` (north, east) of the incident is at ``place``.

        Raises ``msgspec.ValidationError`` for a place that is none on the Earth.
        """
        there = msgspec.convert({**place._asdict(), "bearing_deg": bearing_deg}, cls, strict=True)
        back = there.geodetic(-local_m[0], -local_m[1], 0.0)
        return msgspec.structs.replace(
            there, latitude_deg=back.latitude_deg, longitude_deg=back.longitude_deg
        )

    @classmethod
    def said(cls, message: OriginSet) -> Origin:
        """Return the origin that a message sets."""
        latitude_deg, longitude_deg, height_m, bearing_deg = message.where
        return cls(
            latitude_deg=latitude_deg, longitude_deg=longitude_deg, height_m=height_m,
            bearing_deg=bearing_deg,
        )  # fmt: skip

    def as_message(self, time_ns: TimeNs, sequence: int) -> OriginSet:
        """Return the message that sets it."""
        return OriginSet(
            event_time_ns=time_ns, sequence=sequence, latitude_deg=self.latitude_deg,
            longitude_deg=self.longitude_deg, height_m=self.height_m, bearing_deg=self.bearing_deg,
        )  # fmt: skip

    @cached_property
    def _to_earth(self) -> Transformer:
        return Transformer.from_pipeline(
            "+proj=pipeline "
            f"+step +inv +proj=topocentric +ellps=WGS84 +lat_0={self.latitude_deg!r} "
            f"+lon_0={self.longitude_deg!r} +h_0={self.height_m!r} "
            "+step +inv +proj=cart +ellps=WGS84 "
            "+step +proj=unitconvert +xy_in=rad +xy_out=deg"
        )

    @staticmethod
    def _turned(north_m: T, east_m: T, bearing_deg: float) -> tuple[T, T]:
        cos, sin = math.cos(math.radians(bearing_deg)), math.sin(math.radians(bearing_deg))
        return cos * north_m - sin * east_m, sin * north_m + cos * east_m


def parse_origin(text: str) -> Origin:
    """Return the origin in ``LATITUDE,LONGITUDE[,HEIGHT[,BEARING]]``. Raises ``ValueError``."""
    parts = _ORIGIN.fullmatch(text.replace(" ", ""))
    if parts is None:
        raise ValueError(
            f"--origin {text!r}: write LATITUDE,LONGITUDE[,HEIGHT[,BEARING]] in degrees and "
            "metres, as in 37.5665,126.978,38,12.5"
        )
    told = {
        f"{name}_{'m' if name == 'height' else 'deg'}": float(value)
        for name, value in parts.groupdict().items()
        if value is not None
    }
    try:
        return msgspec.convert(told, Origin)
    except msgspec.ValidationError as error:
        raise ValueError(f"--origin {text!r}: {error}; correct it") from None
