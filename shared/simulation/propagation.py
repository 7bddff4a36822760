"""How radio spreads in a building: what a receiver makes of a transmitter, place by place.

Power falls with range, walls and floors as in the COST 231 multi-wall model (COST Action 231,
final report, section 4.7.2), with an exponent of its own for the range; the wearer's torso takes
more where it stands in the way. On top of that lie shadowing, smooth over metres (Gudmundson,
"Correlation model for shadow fading in mobile radio systems", 1991), and multipath fading, which
changes within a wavelength and is the deeper the weaker the direct path (Rician). Both are fixed
fields of place: somebody who stands still keeps the fade they stand in, and the link is the same
in both directions.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, TypeAlias, get_args

import msgspec
import numpy as np
from msgspec import Meta
from numpy.typing import NDArray
from scipy.special import expit

from shared.simulation.plan import Attenuation, Plan

Array: TypeAlias = NDArray[np.float64]
Decibel: TypeAlias = Annotated[float, Meta(ge=0.0, le=100.0)]
Length: TypeAlias = Annotated[float, Meta(gt=0.0, le=100.0)]

WAVES = 64
"""Plane waves in a random field: enough for its values to be all but Gaussian."""

NEAREST_M = 0.1
"""Antennas count as this far apart at least: nearer, power does not fall with range."""

FLOOR_EXPONENT_OFFSET = 0.46
"""COST 231's b: each further floor costs less than the one before."""


class WallLoss(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What a wall of each class takes. Light and brick are COST 231's light and heavy walls."""

    light: Decibel = 3.4
    brick: Decibel = 6.9
    concrete: Decibel = 12.0


class RadioParameters(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """How radio spreads in the building, and how a DAP hears it: a scenario's ``[radio]``.

    ``power_at_1_m_dbm`` is what an average responder's radio gives an average DAP over a clear
    metre; single devices differ from that with the offsets' standard deviations. The Rician K
    factor, direct path over all others, is ``rician_k_db`` at the antenna and falls with range
    and walls, but not below ``rician_k_least_db``. ``noise_sd_db`` is the spread of readings when
    nothing moves. A reading is lost with ``loss_probability``, and half of what is left at
    ``sensitivity_dbm``. Antennas are ``worn_height_m`` and ``dap_height_m`` above the floor.
    """

    scan_rate_hz: Annotated[float, Meta(gt=0.0, le=100.0)] = 5.0
    power_at_1_m_dbm: Annotated[float, Meta(ge=-100.0, le=30.0)] = -40.0
    path_loss_exponent: Annotated[float, Meta(ge=1.0, le=6.0)] = 2.2
    wall_loss_db: WallLoss = WallLoss()
    floor_loss_db: Decibel = 18.3
    body_loss_db: Decibel = 8.0
    shadowing_sd_db: Decibel = 4.0
    shadowing_length_m: Length = 2.5
    rician_k_db: Decibel = 12.0
    rician_k_fall_db_m: Decibel = 0.9
    rician_k_wall_db: Decibel = 3.0
    rician_k_least_db: Annotated[float, Meta(ge=-40.0, le=40.0)] = -5.0
    wavelength_m: Length = 0.125
    responder_offset_sd_db: Decibel = 2.0
    dap_offset_sd_db: Decibel = 1.5
    noise_sd_db: Decibel = 0.8
    sensitivity_dbm: Annotated[float, Meta(ge=-150.0, le=0.0)] = -92.0
    sensitivity_width_db: Annotated[float, Meta(gt=0.0, le=20.0)] = 1.5
    loss_probability: Annotated[float, Meta(ge=0.0, lt=1.0)] = 0.05
    worn_height_m: Annotated[float, Meta(ge=0.0, le=3.0)] = 1.2
    dap_height_m: Annotated[float, Meta(ge=0.0, le=3.0)] = 0.1


@dataclass(frozen=True)
class RandomField:
    """A complex random field of place, of unit mean power: a sum of plane waves.

    ``wave_rad_m`` (w, 3) are the wave vectors, ``phase_rad`` (w,) their phases at the origin.
    """

    wave_rad_m: Array
    phase_rad: Array

    def at(self, position_m: Array) -> NDArray[np.complex128]:
        """Return the field (n,) at ``position_m`` (n, 3)."""
        waves = np.exp(1j * (position_m @ self.wave_rad_m.T + self.phase_rad))
        return np.asarray(waves.sum(axis=1) / np.sqrt(len(self.phase_rad)))


def smooth_field(length_m: float, chance: np.random.Generator) -> RandomField:
    """Return a field whose values correlate as exp(−d²/2·length²) over a distance d."""
    wave_rad_m = chance.normal(0.0, 1.0 / length_m, (WAVES, 3))
    return RandomField(wave_rad_m, chance.uniform(0.0, 2.0 * np.pi, WAVES))


def multipath_field(wavelength_m: float, chance: np.random.Generator) -> RandomField:
    """Return a field of waves of ``wavelength_m`` that come from all directions alike."""
    direction = chance.normal(size=(WAVES, 3))
    direction *= 2.0 * np.pi / wavelength_m / np.linalg.norm(direction, axis=1, keepdims=True)
    return RandomField(direction, chance.uniform(0.0, 2.0 * np.pi, WAVES))


@dataclass(frozen=True)
class Surroundings:
    """What stands around one DAP: the fields its links run through, by the other end's place."""

    shadowing: RandomField
    multipath: RandomField


def draw_surroundings(radio: RadioParameters, chance: np.random.Generator) -> Surroundings:
    """Draw the surroundings of one DAP."""
    return Surroundings(
        smooth_field(radio.shadowing_length_m, chance),
        multipath_field(radio.wavelength_m, chance),
    )


def mean_power_dbm(
    radio: RadioParameters, plan: Plan, dap_m: Array, body_m: Array, heading_rad: Array
) -> Array:
    """Return the power (n,) between average devices, without shadowing, fading and noise.

    ``dap_m`` (3,) is where the DAP stands, ``body_m`` (n, 3) the floor under the responder, whose
    radio is worn in front and who faces ``heading_rad`` (n,).
    """
    return _mean_power_dbm(radio, plan, dap_m, body_m, heading_rad)[0]


def received_power_dbm(
    radio: RadioParameters,
    plan: Plan,
    around: Surroundings,
    dap_m: Array,
    body_m: Array,
    heading_rad: Array,
) -> Array:
    """Return the power (n,) with shadowing and fading; arguments as in ``mean_power_dbm``."""
    _, radio_m, range_m = _antennas(radio, dap_m, body_m)
    mean_dbm, walls = _mean_power_dbm(radio, plan, dap_m, body_m, heading_rad)
    return np.asarray(mean_dbm + _fading_db(radio, around, range_m, walls, radio_m))


def power_between_worn_dbm(
    radio: RadioParameters,
    plan: Plan,
    around: Surroundings,
    first: tuple[Array, Array],
    second: tuple[Array, Array],
) -> Array:
    """Return the power (n,) between two worn radios, with shadowing and fading.

    ``first`` and ``second`` are where their wearers stand (n, 3) and face (n,); each one's torso
    takes its share. Shadowing and fading change as either of them moves.
    """
    (first_m, first_rad), (second_m, second_rad) = first, second
    # Worn as high above the floor as the other, where a DAP stands almost on it.
    raised_m = second_m - [0.0, 0.0, radio.worn_height_m - radio.dap_height_m]
    antenna_m, radio_m, range_m = _antennas(radio, raised_m, first_m)
    mean_dbm, walls = _mean_power_dbm(radio, plan, raised_m, first_m, first_rad)
    return np.asarray(
        mean_dbm
        - _body_loss_db(radio, second_rad, radio_m - antenna_m, range_m)
        + _fading_db(radio, around, range_m, walls, radio_m + antenna_m)
    )


def rician_k(radio: RadioParameters, range_m: Array, walls: NDArray[np.intp]) -> Array:
    """Return K (n,), the power of the direct path over that of all others, as a ratio."""
    k_db = radio.rician_k_db - radio.rician_k_fall_db_m * range_m - radio.rician_k_wall_db * walls
    return np.asarray(10.0 ** (np.maximum(k_db, radio.rician_k_least_db) / 10.0))


def probability_heard(radio: RadioParameters, power_dbm: Array) -> Array:
    """Return the share (n,) of readings at ``power_dbm`` (n,) that come through."""
    above = (power_dbm - radio.sensitivity_dbm) / radio.sensitivity_width_db
    return np.asarray((1.0 - radio.loss_probability) * expit(above))


def _mean_power_dbm(
    radio: RadioParameters, plan: Plan, dap_m: Array, body_m: Array, heading_rad: Array
) -> tuple[Array, NDArray[np.intp]]:
    """Return what ``mean_power_dbm`` does, and how many walls (n,) each link meets."""
    antenna_m, radio_m, range_m = _antennas(radio, dap_m, body_m)
    power_dbm: Array = radio.power_at_1_m_dbm - 10.0 * radio.path_loss_exponent * np.log10(range_m)
    walls = np.zeros(len(body_m), np.intp)
    for attenuation in get_args(Attenuation):
        crossed = plan.walls_crossed(radio_m, antenna_m, attenuation)
        power_dbm -= getattr(radio.wall_loss_db, attenuation) * crossed
        walls += crossed
    power_dbm -= _floor_loss_db(
        radio, plan.floors_crossed(body_m, np.broadcast_to(dap_m, body_m.shape))
    )
    body_loss_db = _body_loss_db(radio, heading_rad, antenna_m - radio_m, range_m)
    return np.asarray(power_dbm - body_loss_db), walls


def _antennas(radio: RadioParameters, dap_m: Array, body_m: Array) -> tuple[Array, Array, Array]:
    """Return the DAP's antenna (n, 3), the responder's (n, 3), and the range between (n,)."""
    antenna_m = np.broadcast_to(dap_m - [0.0, 0.0, radio.dap_height_m], body_m.shape)
    radio_m = body_m - [0.0, 0.0, radio.worn_height_m]
    range_m = np.maximum(np.linalg.norm(radio_m - antenna_m, axis=1), NEAREST_M)
    return antenna_m, radio_m, range_m


def _body_loss_db(
    radio: RadioParameters, heading_rad: Array, toward_m: Array, range_m: Array
) -> Array:
    """Return what the torso of who faces ``heading_rad`` (n,) takes from a link ``toward_m``."""
    forward = np.column_stack([np.cos(heading_rad), np.sin(heading_rad)])
    ahead = np.sum(forward * toward_m[:, :2], axis=1) / range_m
    return np.asarray(radio.body_loss_db * np.maximum(0.0, -ahead))


def _fading_db(
    radio: RadioParameters,
    around: Surroundings,
    range_m: Array,
    walls: NDArray[np.intp],
    place_m: Array,
) -> Array:
    """Return shadowing and fading (n,) between two antennas, of the fields at ``place_m`` (n, 3).

    ``walls`` (n,) are how many stand between. Shadowing fades in over its own correlation length:
    over a short range nothing stands between.
    """
    grown = np.sqrt(-np.expm1(-range_m / radio.shadowing_length_m))
    shadow = np.sqrt(2.0) * around.shadowing.at(place_m).real
    k = rician_k(radio, range_m, walls)
    amplitude = np.abs(np.sqrt(k) + around.multipath.at(place_m)) / np.sqrt(1.0 + k)
    return np.asarray(radio.shadowing_sd_db * grown * shadow + 20.0 * np.log10(amplitude))


def _floor_loss_db(radio: RadioParameters, floors: NDArray[np.intp]) -> Array:
    """COST 231: the n-th floor costs less than the first; n^((n+2)/(n+1) − b) times one."""
    exponent = (floors + 2.0) / (floors + 1.0) - FLOOR_EXPONENT_OFFSET
    return np.asarray(radio.floor_loss_db * floors**exponent)
