"""The mounts there are, by how the sensor is worn and which method reads it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal, NamedTuple, TypeAlias

from edge_agent.inertial.sample_intake import take
from edge_agent.mounts.boot import BootMount
from edge_agent.mounts.boot_eskf import EskfBootMount
from edge_agent.mounts.chest import ChestMount
from edge_agent.mounts.chest_published import PublishedChestMount
from edge_agent.mounts.interface import Mount
from edge_agent.mounts.upright import UprightMount
from edge_agent.mounts.vehicle import WHEELBASE_M, VehicleMount
from edge_agent.mounts.vehicle_published import PublishedVehicleMount
from edge_agent.mounts.waist import WaistMount
from edge_agent.mounts.waist_published import PublishedWaistMount
from shared.compiled import is_kept
from shared.messages import Mount as Worn

MountName: TypeAlias = Worn
MethodName: TypeAlias = Literal["eskf", "linear", "robust", "published"]


class Told(NamedTuple):
    """What is told of the building, the vehicle or the wearer, as far as it is.

    ``dominant_direction``: hold the heading to where the building's corridors lead.
    ``wheelbase_m``: a vehicle's; the published method does without.
    ``step_scale``: how long the wearer's steps are, in those of nobody in particular.
    """

    dominant_direction: bool = False
    wheelbase_m: float = WHEELBASE_M
    step_scale: float = 1.0


NOTHING_TOLD = Told()

_MOUNTS: dict[MountName, dict[MethodName, Callable[[Told], Mount]]] = {
    "boot": {
        "eskf": lambda told: EskfBootMount(dominant_direction=told.dominant_direction),
        "linear": lambda _: UprightMount(BootMount()),
    },
    "chest": {
        "robust": lambda told: ChestMount(step_scale=told.step_scale),
        "published": lambda told: PublishedChestMount(told.step_scale),
    },
    "waist": {
        "robust": lambda told: WaistMount(step_scale=told.step_scale),
        "published": lambda told: UprightMount(PublishedWaistMount(told.step_scale)),
    },
    "vehicle": {
        "robust": lambda told: VehicleMount(told.wheelbase_m),
        "published": lambda _: PublishedVehicleMount(),
    },
}
"""By mount, the default method first."""

WITHOUT_GYRO: frozenset[MountName] = frozenset({"chest"})
"""What can be worn without a gyroscope: steps are counted, and nothing is known of headings."""

STEPPING: frozenset[MountName] = frozenset({"chest", "waist"})
"""What tells a way step by step, by how hard the body bounces."""


def default_method(mount: MountName) -> MethodName:
    """Return the method that reads ``mount`` unless another is asked for."""
    return next(iter(_methods_of(mount)))


def make_mount(
    mount: MountName, method: MethodName | None = None, told: Told = NOTHING_TOLD
) -> Mount:
    """Return a new mount that reads a sensor worn as ``mount`` by ``method``, its own by default.

    A boot tells one increment a stride. ``eskf``: error-state filter smoothed over each stride,
    from a crawl to a sprint. ``linear``: linear-calibrated zero-velocity update, as published.
    A chest tells one a step; ``published`` is as the paper has it, here and for the others,
    ``robust`` ours. A vehicle tells one a second. Raises ``ValueError`` for a method that the
    mount has not, or that can make nothing of what is ``told``.
    """
    methods = _methods_of(mount)
    method = method or default_method(mount)
    if method not in methods:
        raise ValueError(f"--method {method}: a {mount} is read by {' or '.join(methods)}")
    if told.wheelbase_m != WHEELBASE_M and mount != "vehicle":
        raise ValueError(f"--wheelbase: only of a vehicle, not of a {mount}")
    if told.step_scale != 1.0 and mount not in STEPPING:
        raise ValueError(f"--step-scale: only of a chest or a waist, not of a {mount}")
    if told.dominant_direction and (mount, method) != ("boot", "eskf"):
        raise ValueError(
            f"--dominant-direction: {mount}, {method} cannot; use --mount boot --method eskf"
        )
    return methods[method](told)


def is_built(mount: MountName, method: MethodName) -> bool:
    """Whether a mount that reads by ``method`` finds its machine code on disk, if it has any."""
    return (mount, method) != ("boot", "eskf") or is_kept(take)


def _methods_of(mount: MountName) -> dict[MethodName, Callable[[Told], Mount]]:
    if mount not in _MOUNTS:
        raise ValueError(f"--mount {mount}: no method reads it; there are {', '.join(_MOUNTS)}")
    return _MOUNTS[mount]
