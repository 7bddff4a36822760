"""Which way a phone is turned, however it is held: the gyro's turn about the vertical.

Tilting the phone, or the trunk it hangs on, is no turn: the twist about the vertical is told, of
the whole rotation since the start. Where north is, the magnetometer says once, of the first
standing: a phone is carried through steel and past it, and on the way its field made headings
worse (``docs/mounts.md``).
"""

from __future__ import annotations

import math

from edge_agent.inertial.heading import UNKNOWN_HEADING_SD_RAD, Heading, MagneticHeading
from edge_agent.inertial.trunk_attitude import TrunkAttitude
from shared.maths.angles import wrap_rad
from shared.maths.rotations import Quaternion, Vector3, inverse, multiply, rotate
from shared.messages import ImuSample

AHEAD: Vector3 = (0.0, 1.0, -1.0)
"""In a phone's axes (right, up along the screen, out of it): ahead of who holds it flat before
them, or wears it upright with its back to the front, and of who holds it anywhere in between."""

GRIP_SD_RAD = math.radians(30.0)
"""How far from straight ahead a phone is held."""

SETTLED_S = 0.5
"""After so long gravity's mean is a tilt, and headings have a frame."""


class HeldHeading:
    """Takes samples in order, all with a gyroscope; tells the heading after each. Plain state."""

    def __init__(self) -> None:
        self._attitude = TrunkAttitude()
        self._levelled_s = 0.0
        self._compass = MagneticHeading()
        self._last_rad_s: Vector3 | None = None
        self._first: Quaternion | None = None
        self._heading_rad = 0.0
        self._start: Heading | None = None

    @property
    def settled(self) -> bool:
        """Whether there is a heading."""
        return self._first is not None

    @property
    def bias_sd_rad_s(self) -> float:
        """How well the gyro's bias is known."""
        return self._attitude.bias.sd_rad_s

    @property
    def heading_rad(self) -> float:
        """How the phone is turned; from north, once that has been told."""
        start = self._start or self._heading_to_start_with()
        return wrap_rad(start.heading_rad + self._heading_rad)

    @property
    def start_sd_rad(self) -> float:
        """How well the wearer's heading is known at setting out, or was."""
        return (self._start or self._heading_to_start_with()).sd_rad

    def take(self, sample: ImuSample, since_s: float) -> None:
        """Take in a sample, ``since_s`` after the one before, 0 if none is near."""
        bx, by, bz = sample.rate_rad_s
        ax, ay, az = self._last_rad_s or sample.rate_rad_s
        self._last_rad_s = sample.rate_rad_s
        if since_s <= 0.0:
            return
        mean_rad_s = (0.5 * (ax + bx), 0.5 * (ay + by), 0.5 * (az + bz))
        self._attitude.step(sample.force_m_s2, mean_rad_s, since_s)
        self._levelled_s += since_s
        attitude = self._attitude.nav_from_sensor
        if self._first is None:
            if self._levelled_s < SETTLED_S:
                return
            self._first = attitude
        w, _, _, z = multiply(attitude, inverse(self._first))
        self._heading_rad = 2.0 * math.atan2(z, w)
        if self._start is None and sample.field_ut is not None:
            self._compass.add(rotate(attitude, sample.field_ut))

    def set_out(self) -> None:
        """Let north be where it was found while the wearer stood."""
        if self._start is None:
            self._start = self._heading_to_start_with()

    def _heading_to_start_with(self) -> Heading:
        """Return how the wearer faces at the first moment, as the phone is held."""
        if self._first is None:
            return Heading(0.0, UNKNOWN_HEADING_SD_RAD)
        north, east, _ = rotate(self._first, AHEAD)
        offset = self._compass.offset()
        heading_rad = wrap_rad(math.atan2(east, north) + offset.heading_rad)
        if offset.sd_rad == UNKNOWN_HEADING_SD_RAD:
            return Heading(0.0, UNKNOWN_HEADING_SD_RAD)
        return Heading(heading_rad, math.hypot(offset.sd_rad, GRIP_SD_RAD))
