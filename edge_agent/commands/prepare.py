"""``edge-agent prepare``: what the first start would wait for, done ahead."""

from __future__ import annotations

from time import perf_counter
from typing import Annotated, TypeAlias

import structlog
from cyclopts import Parameter, validators

from edge_agent.mounts.interface import Mount, TakesSpeed
from edge_agent.mounts.methods import (
    NOTHING_TOLD,
    MethodName,
    MountName,
    Told,
    default_method,
    is_built,
    make_mount,
)
from shared.process import ExitCode, end_with_parent, ended_by_signals

DRIVEN_SPEED_SD_M_S = 0.3
"""Of a speed told at the start: a satellite receiver's, or a speedometer's."""

Wheelbase: TypeAlias = Annotated[float, Parameter(validator=validators.Number(gte=1.0, lte=10.0))]
"""Metres; it is seldom more than seven."""

StepScale: TypeAlias = Annotated[float, Parameter(validator=validators.Number(gte=0.5, lte=2.0))]
"""Nobody's steps are half, or twice, as long as they bounce."""

_log = structlog.stdlib.get_logger(__name__)


def prepare(
    *,
    method: MethodName | None = None,
    with_parent: Annotated[bool, Parameter(show=False)] = False,
) -> int:
    """Build the machine code of a boot method, once for all agents on this machine.

    Takes some twenty seconds after an installation, and one second from then on; an agent that
    starts without it does the same first. Example: edge-agent prepare

    Parameters
    ----------
    method
        How the boot's sensor is read: eskf, the default, or linear.
    with_parent
        End when standard input closes.

    """
    if with_parent:
        end_with_parent()
    with ended_by_signals():
        prepared_mount("boot", method)
    return ExitCode.OK


def prepared_mount(
    mount: MountName,
    method: MethodName | None,
    *,
    told: Told = NOTHING_TOLD,
    driven_speed_m_s: float | None = None,
) -> Mount:
    """Return a new mount, whose first sample will wait for nothing; say what takes time.

    ``driven_speed_m_s`` is how fast a vehicle goes at the first sample. Raises ``ValueError`` where
    ``mount`` has no such method, or that can make nothing of what is ``told``, or is no vehicle.
    """
    method = method or default_method(mount)
    if not is_built(mount, method):
        _log.info("building machine code, once: some thirty seconds", method=method)
    began_s = perf_counter()
    made = make_mount(mount, method, told)
    if driven_speed_m_s is not None:
        if not isinstance(made, TakesSpeed):
            raise ValueError(f"--driven-speed: only of a vehicle, not of a {mount}")
        made.know_speed(driven_speed_m_s, DRIVEN_SPEED_SD_M_S)
    seconds = round(perf_counter() - began_s, 2)
    _log.info(f"{mount} method ready", method=method, seconds=seconds)
    return made
