"""A baseline, for comparison only: what a foot-mounted tracker of 2010 makes of a recording.

Zero velocity where the SHOE statistic (Skog, Händel, Nilsson, Rantakokko 2010, "Zero-velocity
detection: an algorithm evaluation", IEEE Trans. Biomed. Eng. 57) is below one fixed threshold; an
error-state Kalman filter of position, velocity and attitude (Foxlin 2005, "Pedestrian tracking with
shoe-mounted inertial sensors") takes it as a measurement of velocity. No biases, no smoothing, one
parameter set. Written from the papers, in plain numpy; its speed says nothing of what C would do.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from edge_agent.evaluation.estimate import EstimatedPath
from edge_agent.evaluation.truth import Array
from edge_agent.sources.recording import Recording
from shared.units import NS_PER_S

GRAVITY_M_S2 = 9.81
WINDOW = 5
FORCE_SCALE_M_S2 = 9.03
RATE_SCALE_RAD_S = 0.804
"""Threshold and noise densities in one, as tuned for boots at 200 Hz: still is a statistic < 1."""

FORCE_NOISE_M_S2 = 0.5
RATE_NOISE_RAD_S = math.radians(0.5)
ZERO_VELOCITY_SD_M_S = 0.01
LEVEL_SD_RAD = math.radians(0.5)
LEVELLING_S = 0.5


def shoe_path(recording: Recording) -> EstimatedPath:
    """Return the path of ``recording``, a sample a knot; the boot stands in its first half second.

    The boot's axes may lie any way; the path's north is the sensor's first heading.
    """
    time_s = recording.time_ns / NS_PER_S
    still = shoe_statistic(recording.force_m_s2, recording.rate_rad_s) < 1.0
    position_m = _navigate(time_s, recording, still)
    edges = np.flatnonzero(np.diff(np.concatenate(([0], still.astype(np.int8), [0]))))
    stances_s = np.column_stack((time_s[edges[0::2]], time_s[edges[1::2] - 1]))
    return EstimatedPath(time_s, position_m, stances_s)


def shoe_statistic(force_m_s2: Array, rate_rad_s: Array) -> Array:
    """Return the statistic (n,) over ``WINDOW`` centred samples; the ends repeat their neighbour.

    Skog et al. 2010, eq. 17: misfit of specific force to gravity along its mean, and angular rate.
    """
    force = sliding_window_view(force_m_s2, WINDOW, axis=0)
    rate = sliding_window_view(rate_rad_s, WINDOW, axis=0)
    mean = force.mean(axis=2, keepdims=True)
    upwards = GRAVITY_M_S2 * mean / np.linalg.norm(mean, axis=1, keepdims=True)
    misfit = np.sum((force - upwards) ** 2, axis=1).mean(axis=1) / FORCE_SCALE_M_S2**2
    turning = np.sum(rate**2, axis=1).mean(axis=1) / RATE_SCALE_RAD_S**2
    return np.pad(misfit + turning, WINDOW // 2, mode="edge")


def _navigate(time_s: Array, recording: Recording, still: NDArray[np.bool_]) -> Array:
    """Integrate, and correct at ``still`` samples; return positions (n, 3), NED."""
    steps_s = np.diff(time_s, prepend=time_s[0])
    turns = Rotation.from_rotvec(recording.rate_rad_s * steps_s[:, None]).as_matrix()
    standing = time_s < time_s[0] + LEVELLING_S
    level, _ = Rotation.align_vectors(
        [[0.0, 0.0, -1.0]], recording.force_m_s2[standing].mean(axis=0, keepdims=True)
    )
    nav_from_body = level.as_matrix()
    gravity = np.array([0.0, 0.0, GRAVITY_M_S2])
    position, velocity = np.zeros(3), np.zeros(3)
    covariance = np.diag([0.0] * 3 + [1e-4] * 3 + [LEVEL_SD_RAD**2] * 3)
    found = np.empty((len(time_s), 3))
    for k, step_s in enumerate(steps_s.tolist()):
        nav_from_body = nav_from_body @ turns[k]
        force = nav_from_body @ recording.force_m_s2[k]
        position = position + step_s * velocity
        velocity = velocity + step_s * (force + gravity)
        covariance = _propagated(covariance, force, step_s)
        if still[k]:
            error, covariance = _corrected(covariance, velocity)
            position = position + error[:3]
            velocity = velocity + error[3:6]
            nav_from_body = Rotation.from_rotvec(error[6:]).as_matrix() @ nav_from_body
        found[k] = position
    return found


def _propagated(covariance: Array, force_m_s2: Array, step_s: float) -> Array:
    """Carry the errors' covariance on: velocity errs as attitude tilts the specific force."""
    x, y, z = force_m_s2
    transition = np.eye(9)
    transition[:3, 3:6] = step_s * np.eye(3)
    transition[3:6, 6:] = -step_s * np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    carried: Array = transition @ covariance @ transition.T
    noise = (
        [0.0] * 3 + [(FORCE_NOISE_M_S2 * step_s) ** 2] * 3 + [(RATE_NOISE_RAD_S * step_s) ** 2] * 3
    )
    return carried + np.diag(noise)


def _corrected(covariance: Array, velocity_m_s: Array) -> tuple[Array, Array]:
    """Return the errors that a velocity of zero tells, and the covariance after it."""
    innovation = covariance[3:6, 3:6] + ZERO_VELOCITY_SD_M_S**2 * np.eye(3)
    gain = np.linalg.solve(innovation, covariance[3:6]).T
    left = covariance - gain @ covariance[3:6]
    return gain @ -velocity_m_s, 0.5 * (left + left.T)
