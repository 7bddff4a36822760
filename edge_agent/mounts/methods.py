"""The mounts there are, by how the sensor is worn and which method reads it."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Literal, TypeAlias

from edge_agent.inertial.sample_intake import take
from edge_agent.mounts.boot import BootMount
from edge_agent.mounts.boot_eskf import EskfBootMount
from edge_agent.mounts.interface import Mount
from edge_agent.mounts.upright import UprightMount
from shared.compiled import is_kept

MountName: TypeAlias = Literal["boot"]
MethodName: TypeAlias = Literal["eskf", "linear"]

DEFAULT_METHOD: MethodName = "eskf"

_MOUNTS: dict[tuple[MountName, MethodName], Callable[[], Mount]] = {
    ("boot", "eskf"): EskfBootMount,
    ("boot", "linear"): lambda: UprightMount(BootMount()),
}
_FOLLOWING_THE_BUILDING: dict[tuple[MountName, MethodName], Callable[[], Mount]] = {
    ("boot", "eskf"): partial(EskfBootMount, dominant_direction=True),
}


def make_mount(mount: MountName, method: MethodName, *, dominant_direction: bool = False) -> Mount:
    """Return a new mount that reads a sensor worn as ``mount`` by ``method``.

    Both tell one increment a stride. ``eskf``: error-state filter smoothed over each stride, from
    a crawl to a sprint. ``linear``: linear-calibrated zero-velocity update, as published.
    ``dominant_direction``: hold the heading to where the building's corridors lead. Raises
    ``ValueError`` for a method that cannot.
    """
    if not dominant_direction:
        return _MOUNTS[mount, method]()
    if (mount, method) not in _FOLLOWING_THE_BUILDING:
        raise ValueError(f"--dominant-direction: {method} cannot; use --method {DEFAULT_METHOD}")
    return _FOLLOWING_THE_BUILDING[mount, method]()


def is_built(method: MethodName) -> bool:
    """Whether a mount that reads by ``method`` finds its machine code on disk, if it has any."""
    return method != "eskf" or is_kept(take)
