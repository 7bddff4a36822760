"""What an inertial sensor makes of the truth: bias, scale, misalignment, noise, ringing, range.

Settings give the spread over sensors; chance draws one sensor. All zero is a perfect one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, TypeAlias

import msgspec
import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

Array: TypeAlias = NDArray[np.float64]
Spread: TypeAlias = Annotated[float, Meta(ge=0.0, le=1e3)]

STANDARD_GRAVITY_M_S2 = 9.80665
RING_S = 0.12
"""How long the strap and the housing ring after a heel strike."""


class ImuSettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A kind of sensor: its rate, its ranges, and the standard deviations of its errors.

    ``*_scale`` and ``rate_error`` are shares; ``misalignment_deg`` is between its axes,
    ``mounting_deg`` between it and the boot. ``*_walk`` is what a bias wanders in a second.
    ``g_sensitivity_deg_s_g`` is angular rate read per g of force; ``ringing`` scales that of heel
    strikes.
    """

    rate_hz: Annotated[float, Meta(ge=20.0, le=2000.0)] = 100.0
    rate_error: Spread = 0.002
    force_range_g: Annotated[float, Meta(gt=1.0)] = 16.0
    rate_range_deg_s: Annotated[float, Meta(gt=10.0)] = 2000.0
    force_bias_m_s2: Spread = 0.05
    force_walk_m_s2: Spread = 0.001
    force_noise_m_s2_rthz: Spread = 0.002
    force_scale: Spread = 0.002
    rate_bias_deg_s: Spread = 0.1
    rate_walk_deg_s: Spread = 0.004
    rate_noise_deg_s_rthz: Spread = 0.01
    rate_scale: Spread = 0.003
    misalignment_deg: Spread = 0.15
    mounting_deg: Spread = 3.0
    g_sensitivity_deg_s_g: Spread = 0.03
    ringing: Spread = 1.0
    hard_iron_ut: Spread = 3.0
    field_noise_ut: Spread = 0.3

    def without_errors(self) -> ImuSettings:
        """Return a perfect sensor of the same rate."""
        names = set(self.__struct_fields__) - {"rate_hz", "force_range_g", "rate_range_deg_s"}
        zeros = dict.fromkeys(names, 0.0)
        return ImuSettings(
            rate_hz=self.rate_hz, force_range_g=math.inf, rate_range_deg_s=math.inf, **zeros
        )


PHONE = ImuSettings(rate_walk_deg_s=0.001)
"""A phone's sensor. At rest, the gyro of such chips wanders by less: 0.0003 to 0.0005 °/s in a
second on the axes of a consumer's tracker, with a noise of 0.007 to 0.008 °/s/√Hz (Allan variance,
libsurvive's wiki, "IMU Variance measurements"); an MPU-6000's is stable to 4.6 °/h over 500 s
(Greenheck 2009, as AirSim has it). What there is more is for the wearer's warmth: of good phones
Android asks for no more than 0.05 °/s for each °C, for a bias known to 0.002 rad/s and a noise of
0.007 °/s/√Hz, 0.014 at most (Compatibility Definition, 7.3.9)."""


@dataclass(frozen=True)
class Sensor:
    """One sensor, drawn. Matrices take the boot's axes to what the sensor reads."""

    settings: ImuSettings
    rate_hz: float
    sensor_from_boot: Array
    force_gain: Array
    rate_gain: Array
    rate_per_force: Array
    force_bias_m_s2: Array
    rate_bias_rad_s: Array
    hard_iron_ut: Array

    def distort(self, force_m_s2: Array, rate_rad_s: Array) -> tuple[Array, Array]:
        """Return what the sensing elements (n, 3) make of true force and rate in boot axes."""
        force = force_m_s2 @ self.sensor_from_boot.T
        rate = rate_rad_s @ self.sensor_from_boot.T + force @ self.rate_per_force.T
        return self._clip(force @ self.force_gain.T, rate @ self.rate_gain.T)

    def read(
        self, force_m_s2: Array, rate_rad_s: Array, chance: np.random.Generator
    ) -> tuple[Array, Array]:
        """Return the samples (n, 3): with biases that wander, noise, and clipped to the range."""
        s, size = self.settings, force_m_s2.shape
        force = self._wander(s.force_walk_m_s2, s.force_noise_m_s2_rthz, size, chance)
        rate = np.radians(self._wander(s.rate_walk_deg_s, s.rate_noise_deg_s_rthz, size, chance))
        force += force_m_s2 + self.force_bias_m_s2
        rate += rate_rad_s + self.rate_bias_rad_s
        return self._clip(force, rate)

    def read_field(self, field_ut: Array, chance: np.random.Generator) -> Array:
        """Return what the magnetometer reads of the true field (n, 3) in boot axes."""
        noise_ut = chance.normal(0.0, 1.0, field_ut.shape) * self.settings.field_noise_ut
        return np.asarray(field_ut @ self.sensor_from_boot.T + self.hard_iron_ut + noise_ut)

    def _wander(
        self, walk: float, noise: float, size: tuple[int, ...], chance: np.random.Generator
    ) -> Array:
        """Return a bias that wanders by ``walk`` in a second, and white noise of that density."""
        steps = chance.normal(0.0, walk / math.sqrt(self.rate_hz), size)
        white = chance.normal(0.0, noise * math.sqrt(0.5 * self.rate_hz), size)
        return np.cumsum(steps, axis=0) + white

    def _clip(self, force_m_s2: Array, rate_rad_s: Array) -> tuple[Array, Array]:
        most_m_s2 = self.settings.force_range_g * STANDARD_GRAVITY_M_S2
        most_rad_s = math.radians(self.settings.rate_range_deg_s)
        return (
            np.clip(force_m_s2, -most_m_s2, most_m_s2),
            np.clip(rate_rad_s, -most_rad_s, most_rad_s),
        )


def draw_sensor(settings: ImuSettings, chance: np.random.Generator) -> Sensor:
    """Return one sensor of the kind that ``settings`` describes."""
    s = settings

    def gain(scale: float) -> Array:
        skew = chance.normal(0.0, 1.0, (3, 3)) * math.radians(s.misalignment_deg)
        np.fill_diagonal(skew, 1.0 + chance.normal(0.0, 1.0, 3) * scale)
        return skew

    mounted_rad = chance.normal(0.0, 1.0, 3) * math.radians(s.mounting_deg)
    rate_per_force = chance.normal(0.0, 1.0, (3, 3)) * (
        math.radians(s.g_sensitivity_deg_s_g) / STANDARD_GRAVITY_M_S2
    )
    return Sensor(
        settings=s,
        rate_hz=s.rate_hz * (1.0 + s.rate_error * float(np.clip(chance.normal(), -2.0, 2.0))),
        sensor_from_boot=_rotation(mounted_rad),
        force_gain=gain(s.force_scale),
        rate_gain=gain(s.rate_scale),
        rate_per_force=rate_per_force,
        force_bias_m_s2=chance.normal(0.0, 1.0, 3) * s.force_bias_m_s2,
        rate_bias_rad_s=chance.normal(0.0, 1.0, 3) * math.radians(s.rate_bias_deg_s),
        hard_iron_ut=chance.normal(0.0, 1.0, 3) * s.hard_iron_ut,
    )


def ringing(
    strike_s: Array,
    strike_m_s2: Array,
    start_s: float,
    step_s: float,
    count: int,
    chance: np.random.Generator,
) -> Array:
    """Return the force (count, 3) of a housing that rings after each strike.

    It is told every ``step_s`` from ``start_s``; ``strike_s`` and ``strike_m_s2`` (k,) are when,
    after that, and how hard the strikes are. Each is the second difference of
    a damped shift that begins and ends at rest, so that it moves the sensor nowhere.
    """
    total = np.zeros((count, 3))
    since_s = np.arange(round(RING_S / step_s)) * step_s
    for moment_s, strength_m_s2 in zip(strike_s, strike_m_s2, strict=True):
        hertz, decay_s = chance.uniform(25.0, 55.0), chance.uniform(0.008, 0.016)
        omega = 2.0 * math.pi * hertz
        onset = 1.0 - np.exp(-((since_s / 0.004) ** 3))
        fade = np.exp(-since_s / decay_s) * (1.0 - since_s / RING_S) ** 2
        shift = onset * fade * np.sin(omega * since_s)
        shift[[0, 1, -2, -1]] = 0.0
        push = np.zeros_like(shift)
        push[1:-1] = np.diff(shift, 2) / (omega * step_s) ** 2
        toward = chance.normal(0.0, 1.0, 3)
        first = round((moment_s - start_s) / step_s)
        part = total[first : first + len(push)]
        part += strength_m_s2 * push[: len(part), None] * toward
    return total


def _rotation(vector_rad: Array) -> Array:
    """Return the matrix of the rotation by the vector (3,) (Rodrigues' formula)."""
    angle = float(np.linalg.norm(vector_rad))
    if angle == 0.0:
        return np.eye(3)
    x, y, z = vector_rad / angle
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + math.sin(angle) * cross + (1 - math.cos(angle)) * cross @ cross)
