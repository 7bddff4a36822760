"""What is wrong with a responder's unit, or with a DAP, in an exercise."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping
from typing import Annotated, NamedTuple, TypeAlias, overload

import msgspec
import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from shared.messages import NodeId, Vector3

Seconds: TypeAlias = Annotated[float, Meta(ge=0.0, le=1e5)]

OF_UNITS = frozenset({"restarts_s", "scale", "turned_deg"})
OF_DAPS = frozenset({"moved_to_m", "moved_by_m", "replays_s", "jammed"})


class Fault(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What is wrong with one node from ``since_s`` to ``until_s``, seconds of the exercise.

    A responder's strides come out longer by the factor ``scale``; their unit is another one, or
    turned on the foot, by ``turned_deg``, and does not say so. A DAP stands at ``moved_to_m``
    (north, east, down), or ``moved_by_m`` off where it stood, where somebody put it; what it heard
    is sent once more ``replays_s`` later; ``jammed``, it hears whoever is there now and then, and
    not when they pass. The clock of either is ahead by ``clock_ahead_s``; its radio and that of
    ``swapped_with``, another one of its kind, go by each other's names.

    At any time a responder's unit starts anew at each of ``restarts_s``, knowing neither where it
    is nor how it heads.
    """

    restarts_s: tuple[Seconds, ...] = ()
    scale: Annotated[float, Meta(gt=0.1, le=10.0)] = 1.0
    clock_ahead_s: Annotated[float, Meta(ge=-3600.0, le=3600.0)] = 0.0
    since_s: Seconds = 0.0
    until_s: Annotated[float, Meta(gt=0.0)] = math.inf
    turned_deg: Annotated[float, Meta(ge=-180.0, le=180.0)] = 0.0
    moved_to_m: Vector3 | None = None
    moved_by_m: Vector3 | None = None
    jammed: bool = False
    replays_s: Annotated[float, Meta(gt=0.0, le=1e4)] | None = None
    swapped_with: NodeId | None = None

    def __post_init__(self) -> None:
        """Refuse what ends before it begins, and a DAP put in two places."""
        if self.until_s <= self.since_s:
            raise ValueError("until_s: let it be after since_s")
        if self.moved_to_m is not None and self.moved_by_m is not None:
            raise ValueError("moved_by_m: give it or moved_to_m")

    @overload
    def is_so(self, time_s: float) -> bool: ...

    @overload
    def is_so(self, time_s: NDArray[np.float64]) -> NDArray[np.bool_]: ...

    def is_so(self, time_s: float | NDArray[np.float64]) -> bool | NDArray[np.bool_]:
        """Say at which times, one or (n,), it is wrong."""
        return (time_s >= self.since_s) & (time_s < self.until_s)

    def clock_ahead_at_s(self, time_s: float) -> float:
        """Return by how much the node's clock is ahead (s)."""
        return self.clock_ahead_s if self.is_so(time_s) else 0.0

    def told(self) -> set[str]:
        """Return which fields say something."""
        return {
            each for each in self.__struct_fields__ if getattr(self, each) != getattr(NONE, each)
        }


NONE = Fault()


class Swap(NamedTuple):
    """By whose name a node's radio goes, while the fault is so."""

    other_id: NodeId
    fault: Fault


def swap_of(faults: Mapping[NodeId, Fault], node_id: NodeId) -> Swap | None:
    """Return with whom a node's radio is swapped, whichever of the two says so."""
    for one_id, fault in faults.items():
        if fault.swapped_with is not None and node_id in (one_id, fault.swapped_with):
            other_id = fault.swapped_with if node_id == one_id else one_id
            return Swap(other_id, fault)
    return None


def misplaced(
    faults: Mapping[NodeId, Fault], responders: Collection[NodeId], daps: Collection[NodeId]
) -> Iterator[str]:
    """Say which faults are nobody's, or of a kind that their node cannot have."""
    for node_id, fault in faults.items():
        where = f"faults.{node_id}"
        if node_id not in responders and node_id not in daps:
            yield f"{where}: nobody is called so, and no DAP"
            continue
        alike, wrong = (responders, OF_DAPS) if node_id in responders else (daps, OF_UNITS)
        for field in sorted(fault.told() & wrong):
            yield f"{where}.{field}: not of a {'responder' if alike is responders else 'DAP'}"
        if fault.swapped_with is not None and fault.swapped_with not in set(alike) - {node_id}:
            yield f"{where}.swapped_with: {fault.swapped_with!r} is no other one of its kind"
