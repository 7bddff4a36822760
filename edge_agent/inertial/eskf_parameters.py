"""The one parameter set of the boot's error-state filter, in SI units and seconds.

Parameters, what is derived from them at a sampling rate, and state are kept apart. A kernel reads
parameters and windows from one record (:func:`kernel_parameters`).
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

Parameters: TypeAlias = NDArray[np.void]
"""What :func:`kernel_parameters` gives: an array of one record."""

ParametersRecord: TypeAlias = Any
"""That record, whose fields numba reads as attributes."""

CAPACITY = 2048
"""Slots of every ring: the longest stride and the look-ahead must fit at the sampling rate."""

LOWEST_RATE_HZ, HIGHEST_RATE_HZ = 40.0, 520.0


class EskfParameters(NamedTuple):
    """What can be chosen; the defaults hold from a crawl to a sprint.

    Standard deviations per sample are meant at ``reference_period_s``; at another rate they are
    scaled so that a second of data weighs alike.
    """

    gravity_m_s2: float = 9.81

    # Zero velocity (zero_velocity.py). 1.0 of the statistic is the customary SHOE threshold.
    window_s: float = 0.045
    force_scale_m_s2: float = 9.03
    rate_scale_rad_s: float = 0.804
    strong_limit: float = 0.12
    strong_guard_s: float = 0.24
    deep_past_s: float = 0.45
    look_ahead_s: float = 0.35
    deep_ratio: float = 1.3
    deep_limit: float = 60.0

    # Which of them the filter believes: by innovation, by speed, or because it has waited long.
    gate_innovation: float = 36.0
    gate_speed_m_s: float = 0.25
    gate_strong_timeout_s: float = 1.0  # a crawling boot slides evenly for longer than half that
    gate_deep_timeout_s: float = 0.7
    gate_deep_way_m: float = 3.0

    widest: float = 100.0

    # Process noise that follows motion.
    reference_period_s: float = 0.005
    force_sd_m_s2: float = 0.15
    force_sd_share: float = 0.03
    rate_sd_rad_s: float = math.radians(1.0)
    rate_sd_share: float = 0.015
    lost_turn_share: float = 0.15
    force_bias_walk: float = 1e-3
    rate_bias_walk: float = 1e-4

    # Saturated and bridged samples (saturation.py, gap_bridging.py).
    flat_top_floor_rad_s: float = 4.5
    flat_top_share: float = 0.94
    flat_top_tolerance: float = 0.006
    peak_gain: float = 1.3
    peak_cap: float = 1.0
    peak_doubt: float = 3.0
    bridged_force_sd_m_s2: float = 15.0
    bridged_rate_sd_rad_s: float = 3.5

    # Zero-velocity and zero-rate updates.
    velocity_sd_m_s: float = 0.03
    velocity_sd_per_rate_m: float = 0.2
    zero_rate_limit: float = 0.003
    zero_rate_time_s: float = 0.2
    zero_rate_sd_rad_s: float = math.radians(0.05)
    sway_share: float = 0.45

    # Standing for so long on what accelerates by more than this, as a lift does (boot_filter.py).
    carried_after_s: float = 0.5
    carried_m_s2: float = 0.25
    carried_factor: float = 10.0

    # What is known at the start.
    rolling_height_m: float = 0.07
    rolling_height_sd_m: float = 0.008
    initial_velocity_sd_m_s: float = 1e-3
    initial_tilt_sd_rad: float = math.radians(0.3)
    moving_tilt_sd_rad: float = math.radians(10.0)
    initial_force_bias_sd_m_s2: float = 0.05
    initial_rate_bias_sd_rad_s: float = 0.005
    moving_rate_rad_s: float = 0.5

    # What a published increment's covariance says beyond the filter's own.
    swing_s: float = 0.15
    level_covariance_factor: float = 0.35
    level_innovation_factor: float = 0.8
    heading_covariance_factor: float = 1.15
    heading_innovation_factor: float = 0.6
    largest_innovation: float = 10.0
    placement_sd_m: float = 0.006
    placement_sd_per_tilt_m: float = 0.55
    placement_sd_per_turn_m: float = 0.0135
    largest_tilt_rad: float = 0.5
    down_covariance_factor: float = 0.35
    down_placement_sd_m: float = 0.01
    down_correction_share: float = 0.7

    # Bridging gaps with the wearer's last strides.
    bridge_shortest_period_s: float = 0.35
    bridge_longest_period_s: float = 10.0
    bridge_apart_s: float = 0.25
    bridge_force_fade_s: float = 0.01
    bridge_rate_fade_s: float = 0.07
    bridge_margin_s: float = 0.10
    bridge_force_scale_m_s2: float = 10.0
    bridge_rate_scale_rad_s: float = 1.0

    # Cutting the track into strides.
    settle_s: float = 0.10
    moving_speed_m_s: float = 0.25
    standing_interval_s: float = 1.0
    longest_stride_s: float = 3.0


class Windows(NamedTuple):
    """Windows in samples at one sampling rate."""

    half_window: int
    look_ahead: int
    deep_past: int
    guard: int
    settle: int
    standing: int
    longest: int
    zero_rate: int
    carried_after: int
    bridge_shortest: int
    bridge_longest: int
    bridge_margin: int
    bridge_apart: int
    bridge_force_fade: int
    bridge_rate_fade: int


def windows_at(parameters: EskfParameters, rate_hz: float) -> Windows:
    """Return the windows of ``parameters`` in samples at ``rate_hz``.

    Raises ValueError when the rings cannot hold a stride, or a swing cannot be resolved.
    """
    if not LOWEST_RATE_HZ <= rate_hz <= HIGHEST_RATE_HZ:
        raise ValueError(
            f"a boot sensor at {rate_hz:.0f} Hz: give {LOWEST_RATE_HZ:.0f} to "
            f"{HIGHEST_RATE_HZ:.0f} Hz, averaging a faster one down"
        )

    def samples(seconds: float) -> int:
        return max(1, round(seconds * rate_hz))

    return Windows(
        half_window=max(1, samples(parameters.window_s) // 2),
        look_ahead=samples(parameters.look_ahead_s),
        deep_past=samples(parameters.deep_past_s),
        guard=samples(parameters.strong_guard_s),
        settle=samples(parameters.settle_s),
        standing=samples(parameters.standing_interval_s),
        longest=samples(parameters.longest_stride_s),
        zero_rate=samples(parameters.zero_rate_time_s),
        carried_after=samples(parameters.carried_after_s),
        bridge_shortest=samples(parameters.bridge_shortest_period_s),
        bridge_longest=samples(parameters.bridge_longest_period_s),
        bridge_margin=samples(parameters.bridge_margin_s),
        bridge_apart=samples(parameters.bridge_apart_s),
        bridge_force_fade=samples(parameters.bridge_force_fade_s),
        bridge_rate_fade=samples(parameters.bridge_rate_fade_s),
    )


def kernel_parameters(parameters: EskfParameters, rate_hz: float) -> Parameters:
    """Return ``parameters`` and their windows at ``rate_hz`` as the record the kernels read.

    It comes in an array of one, which numba takes in at a twentieth of what a record alone costs.
    """
    windows = windows_at(parameters, rate_hz)
    layout: Any = [(name, np.float64) for name in EskfParameters._fields]
    layout += [(name, np.int64) for name in Windows._fields]
    return np.array([(*parameters, *windows)], dtype=layout)
