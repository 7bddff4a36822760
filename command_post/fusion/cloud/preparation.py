"""Machine code, built ahead: what the first cloud would keep the post waiting for."""

from __future__ import annotations

import numpy as np

from command_post.fusion.cloud.chance import Key
from command_post.fusion.cloud.cloud import moments, spawn
from command_post.fusion.cloud.layout import LANES
from command_post.fusion.cloud.model import Mixture
from command_post.fusion.cloud.regions import regions


def prepare() -> None:
    """Have every kernel built, or loaded: seconds once after an installation, then hardly any."""
    apart = np.zeros((2, 4))
    apart[1, 0] = 30.0
    cloud = spawn(Mixture(np.ones(2), apart, np.stack([np.eye(4)] * 2)), LANES, Key(1, 1))
    regions(cloud, moments(cloud))
