"""What a cloud is told: the noise of a stride, a place to be tied to, a mixture to begin with."""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple, TypeAlias

import msgspec
import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

Floats: TypeAlias = NDArray[np.float64]
Noise: TypeAlias = Annotated[float, Meta(ge=0.0, le=100.0)]
Share: TypeAlias = Annotated[float, Meta(ge=0.0, le=0.5)]


class CloudModel(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """How a stride may differ from what its increment tells, and when a cloud is resampled.

    What the increment's own covariance says comes on top. North and east get ``position_sd_m`` +
    ``position_sd_per_m`` × its length and, for each increment known to be lost before it,
    ``lost_sd_m``; the heading ``heading_sd_rad``. In ``jump_share`` of strides the heading jumps,
    give or take ``jump_sd_rad``; ``missed_share`` hide another stride like them that was not
    told. The heading's drift walks by ``drift_walk_rad_s`` in a second, and as √t. Below
    ``resample_below`` × the number of particles as effective count the cloud is resampled; copies
    keep ``kept_spread`` of their own drift and log-scale and get the rest afresh.
    """

    position_sd_m: Noise = 0.02
    position_sd_per_m: Noise = 0.035
    lost_sd_m: Noise = 1.0
    heading_sd_rad: Noise = math.radians(0.7)
    jump_share: Share = 0.01
    jump_sd_rad: Noise = math.radians(6.0)
    missed_share: Share = 0.004
    drift_walk_rad_s: Noise = math.radians(0.004)
    resample_below: Annotated[float, Meta(ge=0.0, le=1.0)] = 0.5
    kept_spread: Annotated[float, Meta(gt=0.0, le=1.0)] = 0.99


class Tie(NamedTuple):
    """A responder was at a place, or near it, at some moment within the last strides.

    The place has a covariance (nn, ne, ee) of its own; ``sd_m`` each way is what they may have
    been off it. The likelihood is Student's t with ``dof`` degrees of freedom. ``since_m`` is the
    displacement (north, east) in the agent's frame from that moment until now.
    """

    north_m: float
    east_m: float
    covariance_m2: tuple[float, float, float]
    sd_m: float
    dof: float = 4.0
    since_m: tuple[float, float] = (0.0, 0.0)


class Mixture(NamedTuple):
    """Where a responder may be: k Gaussians over (north, east, φ, log-scale[, drift]).

    ``weights`` (k,) need not sum to one; ``means`` (k, 4 or 5) in m, rad, 1 and rad/s;
    ``covariances`` (k, 4 or 5, 4 or 5). A φ known no better than ``ANY_HEADING_SD_RAD`` may be
    anything. Without the fifth column nobody's heading drifts.
    """

    weights: Floats
    means: Floats
    covariances: Floats


ANY_HEADING_SD_RAD = 2.0
