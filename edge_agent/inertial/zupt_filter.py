"""The error-state filter of a boot: structured propagation, scalar updates, no matrix inverse.

Error states, navigation axes north-east-down: position (0–2), velocity (3–5), attitude (6–8, a
rotation vector applied on the left), then in body axes the biases of the accelerometer (9–11) and
of the gyro (12–14), the rolling height of the foot (15), and the heading error at the start of the
stride (16): a clone of state 8, without which an increment's covariance could not be told apart
from the heading it started with.

Foxlin 2005, "Pedestrian tracking with shoe-mounted inertial sensors"; Solà 2017, "Quaternion
kinematics for the error-state Kalman filter", §7. A departure: the foot at stance is not still but
rolls over its contact, ``v = ω × (0, 0, −h)``, with ``h`` estimated per wearer.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from edge_agent.inertial.eskf_parameters import ParametersRecord
from edge_agent.inertial.sample_ring import BRIDGED, DOUBT, RATE, RATE_DOUBT, RESTORED
from shared.compiled import compiled

STATES = 17
POSITION, VELOCITY, ATTITUDE, FORCE_BIAS, RATE_BIAS = 0, 3, 6, 9, 12
HEADING, ROLLING_HEIGHT, START_HEADING = 8, 15, 16

Array = NDArray[np.float64]


def transition_matrix(dt_s: float, force_nav_m_s2: Array, nav_from_body: Array) -> Array:
    """Dense F of one sample, as the kernels below mean it."""
    x, y, z = force_nav_m_s2 * dt_s
    transition = np.eye(STATES)
    transition[0:3, 3:6] = np.eye(3) * dt_s
    transition[3:6, 6:9] = [[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]]
    transition[3:6, 9:12] = transition[6:9, 12:15] = -dt_s * nav_from_body
    return transition


@compiled
def propagate_covariance(covariance: Array, transition: Array) -> None:
    """``P ← F·P·Fᵀ`` in place. ``transition`` is dt, dt·f_nav (3), −dt·nav_from_body (9).

    Only rows 0–8 of F differ from the identity, so rows then columns 0–8 are all that change.
    """
    dt, x, y, z = transition[0], transition[1], transition[2], transition[3]
    b = transition[4:13].reshape((3, 3))
    size = covariance.shape[0]
    for j in range(size):
        t0, t1, t2 = covariance[6, j], covariance[7, j], covariance[8, j]
        a0, a1, a2 = covariance[9, j], covariance[10, j], covariance[11, j]
        g0, g1, g2 = covariance[12, j], covariance[13, j], covariance[14, j]
        for c in range(3):
            covariance[c, j] += dt * covariance[3 + c, j]
            covariance[3 + c, j] += b[c, 0] * a0 + b[c, 1] * a1 + b[c, 2] * a2
            covariance[6 + c, j] += b[c, 0] * g0 + b[c, 1] * g1 + b[c, 2] * g2
        covariance[3, j] += z * t1 - y * t2
        covariance[4, j] += x * t2 - z * t0
        covariance[5, j] += y * t0 - x * t1
    for i in range(9):
        row = covariance[i]
        t0, t1, t2 = row[6], row[7], row[8]
        for c in range(3):
            row[c] += dt * row[3 + c]
            row[3 + c] += b[c, 0] * row[9] + b[c, 1] * row[10] + b[c, 2] * row[11]
            row[6 + c] += b[c, 0] * row[12] + b[c, 1] * row[13] + b[c, 2] * row[14]
        row[3] += z * t1 - y * t2
        row[4] += x * t2 - z * t0
        row[5] += y * t0 - x * t1
    for i in range(9):
        for j in range(i + 1, size):
            covariance[j, i] = covariance[i, j]


@compiled
def scalar_update(
    covariance: Array,
    gain: Array,
    correction: Array,
    state: int,
    height_factor: float,
    variance: float,
    residual: float,
) -> float:
    """Take one measurement ``z = x[state] + height_factor·x[ROLLING_HEIGHT] + noise`` in.

    ``residual`` is as before any measurement of this sample, what they made of it stands in
    ``correction``, which is added to. Writes ``gain``, returns innovation over its variance.
    """
    size = covariance.shape[0]
    innovation = residual - correction[state] - height_factor * correction[ROLLING_HEIGHT]
    for i in range(size):
        gain[i] = covariance[i, state] + height_factor * covariance[i, ROLLING_HEIGHT]
    inverse = 1.0 / (gain[state] + height_factor * gain[ROLLING_HEIGHT] + variance)
    for i in range(size):
        share = gain[i] * inverse
        row = covariance[i]
        for j in range(size):
            row[j] -= share * gain[j]
        correction[i] += share * innovation
    for i in range(size):
        gain[i] *= inverse
    return float(innovation * inverse)


@compiled
def velocity_innovation(covariance: Array, variance: float, residual: Array) -> float:
    """Squared Mahalanobis distance ``rᵀ(P_vv + σ²I)⁻¹r`` of a velocity residual (3,)."""
    a, b, c = covariance[3, 3] + variance, covariance[3, 4], covariance[3, 5]
    d, e, f = covariance[4, 4] + variance, covariance[4, 5], covariance[5, 5] + variance
    aa, ab, ac = d * f - e * e, c * e - b * f, b * e - c * d
    bb, bc, cc = a * f - c * c, b * c - a * e, a * d - b * b
    x, y, z = residual[0], residual[1], residual[2]
    weighted = aa * x * x + bb * y * y + cc * z * z + 2.0 * (ab * x * y + ac * x * z + bc * y * z)
    return float(weighted / (a * aa + b * ab + c * ac))


@compiled
def add_process_noise(
    covariance: Array,
    transition: Array,
    force: Array,
    rate: Array,
    row: Array,
    before: Array,
    p: ParametersRecord,
) -> None:
    """Add Q of one sample: noise grows with motion, with what a sensor clipped and with a gap.

    It also grows with how far the rate leaps from sample to sample: under a hard heel the boot
    rings faster than it is sampled, and part of the turn between two samples is lost. ``force``
    and ``rate`` are bias-free, in body axes; ``row`` and ``before`` are the rows of the ring of
    this sample and of the one before.
    """
    dt = transition[0]
    scale = p.reference_period_s * dt
    force_norm = math.sqrt(force[0] ** 2 + force[1] ** 2 + force[2] ** 2)
    rate_norm = math.sqrt(rate[0] ** 2 + rate[1] ** 2 + rate[2] ** 2)
    force_sd = p.force_sd_m_s2 + p.force_sd_share * abs(force_norm - p.gravity_m_s2)
    rate_sd = p.rate_sd_rad_s + p.rate_sd_share * rate_norm
    if row[BRIDGED] > 0.0:
        force_sd = max(force_sd, row[DOUBT] * p.bridged_force_sd_m_s2)
        rate_sd = max(rate_sd, row[RATE_DOUBT] * p.bridged_rate_sd_rad_s)
    leap = 0.0
    for c in range(RATE, RATE + 3):
        leap += (row[c] - before[c]) ** 2
    lost = p.lost_turn_share * dt
    turn_variance = rate_sd * rate_sd * scale + lost * lost * leap
    for c in range(3):
        covariance[3 + c, 3 + c] += force_sd * force_sd * scale
        covariance[6 + c, 6 + c] += turn_variance
        covariance[9 + c, 9 + c] += p.force_bias_walk * p.force_bias_walk * dt
        covariance[12 + c, 12 + c] += p.rate_bias_walk * p.rate_bias_walk * dt
        doubt = p.peak_doubt * row[RESTORED + c]
        if doubt > 0.0:
            axis = doubt * doubt * p.reference_period_s / dt
            for i in range(3):
                for j in range(3):
                    covariance[6 + i, 6 + j] += (
                        axis * transition[4 + 3 * i + c] * transition[4 + 3 * j + c]
                    )


@compiled
def widen_covariance(covariance: Array, factor: float) -> None:
    """Widen position, velocity and attitude to ``factor`` times their covariance, as noise added.

    For a filter whose innovation shows that it has known less than it thought.
    """
    for i in range(9):
        for j in range(9):
            covariance[i, j] *= factor
