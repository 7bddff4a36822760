"""The mounts there are, by how the sensor is worn and which method reads it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal, TypeAlias

from edge_agent.mounts.boot import BootMount
from edge_agent.mounts.interface import Mount

MountName: TypeAlias = Literal["boot"]
MethodName: TypeAlias = Literal["linear"]

_MOUNTS: dict[tuple[MountName, MethodName], Callable[[], Mount]] = {("boot", "linear"): BootMount}


def make_mount(mount: MountName, method: MethodName) -> Mount:
    """Return a new mount that reads a sensor worn as ``mount`` by ``method``.

    ``linear``: linear-calibrated zero-velocity update, one increment a stride.
    """
    return _MOUNTS[mount, method]()
