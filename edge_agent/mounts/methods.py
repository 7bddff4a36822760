"""The mounts there are, by how the sensor is worn and which method reads it."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Literal, TypeAlias

from edge_agent.inertial.sample_intake import take
from edge_agent.mounts.boot import BootMount
from edge_agent.mounts.boot_eskf import EskfBootMount
from edge_agent.mounts.chest import ChestMount
from edge_agent.mounts.chest_published import PublishedChestMount
from edge_agent.mounts.interface import Mount
from edge_agent.mounts.upright import UprightMount
from edge_agent.mounts.vehicle import VehicleMount
from edge_agent.mounts.vehicle_published import PublishedVehicleMount
from edge_agent.mounts.waist import WaistMount
from edge_agent.mounts.waist_published import PublishedWaistMount
from shared.compiled import is_kept
from shared.messages import Mount as Worn

MountName: TypeAlias = Worn
MethodName: TypeAlias = Literal["eskf", "linear", "robust", "published"]

_MOUNTS: dict[MountName, dict[MethodName, Callable[[], Mount]]] = {
    "boot": {"eskf": EskfBootMount, "linear": lambda: UprightMount(BootMount())},
    "chest": {"robust": ChestMount, "published": PublishedChestMount},
    "waist": {"robust": WaistMount, "published": lambda: UprightMount(PublishedWaistMount())},
    "vehicle": {"robust": VehicleMount, "published": PublishedVehicleMount},
}
"""By mount, the default method first."""

_FOLLOWING_THE_BUILDING: dict[tuple[MountName, MethodName], Callable[[], Mount]] = {
    ("boot", "eskf"): partial(EskfBootMount, dominant_direction=True),
}

WITHOUT_GYRO: frozenset[MountName] = frozenset({"chest"})
"""What can be worn without a gyroscope: steps are counted, and nothing is known of headings."""


def default_method(mount: MountName) -> MethodName:
    """Return the method that reads ``mount`` unless another is asked for."""
    return next(iter(_methods_of(mount)))


def make_mount(
    mount: MountName,
    method: MethodName | None = None,
    *,
    dominant_direction: bool = False,
    wheelbase_m: float | None = None,
) -> Mount:
    """Return a new mount that reads a sensor worn as ``mount`` by ``method``, its own by default.

    A boot tells one increment a stride. ``eskf``: error-state filter smoothed over each stride,
    from a crawl to a sprint. ``linear``: linear-calibrated zero-velocity update, as published.
    A chest tells one a step; ``published`` is as the paper has it, here and for the others,
    ``robust`` ours. A vehicle tells one a second. ``dominant_direction``: hold the heading to
    where the building's corridors lead. ``wheelbase_m``: a vehicle's, if it is not a car's; the
    published method does without. Raises ``ValueError`` for a method that the mount has not, or
    that cannot.
    """
    methods = _methods_of(mount)
    method = method or default_method(mount)
    if method not in methods:
        raise ValueError(f"--method {method}: a {mount} is read by {' or '.join(methods)}")
    if wheelbase_m is not None and mount != "vehicle":
        raise ValueError(f"--wheelbase: only of a vehicle, not of a {mount}")
    if not dominant_direction:
        if wheelbase_m is not None and method == "robust":
            return VehicleMount(wheelbase_m)
        return methods[method]()
    if (mount, method) not in _FOLLOWING_THE_BUILDING:
        able = ", ".join(f"--mount {one} --method {by}" for one, by in _FOLLOWING_THE_BUILDING)
        raise ValueError(f"--dominant-direction: {mount}, {method} cannot; use {able}")
    return _FOLLOWING_THE_BUILDING[mount, method]()


def is_built(mount: MountName, method: MethodName) -> bool:
    """Whether a mount that reads by ``method`` finds its machine code on disk, if it has any."""
    return (mount, method) != ("boot", "eskf") or is_kept(take)


def _methods_of(mount: MountName) -> dict[MethodName, Callable[[], Mount]]:
    if mount not in _MOUNTS:
        raise ValueError(f"--mount {mount}: no method reads it; there are {', '.join(_MOUNTS)}")
    return _MOUNTS[mount]
