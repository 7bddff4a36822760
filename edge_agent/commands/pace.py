"""``edge-agent pace``: a wearer's own step scale, by walks of a known length."""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np
import structlog
from cyclopts import Parameter, validators
from rich.console import Console

from edge_agent.evaluation.pace import Stepping, steady_length_m
from edge_agent.mounts.methods import MethodName, make_mount
from edge_agent.sources.opening import open_source
from edge_agent.sources.recording import SourceError
from shared.config import ConfigError
from shared.messages import ImuSample
from shared.process import ExitCode

_log = structlog.stdlib.get_logger(__name__)


class _Walk(NamedTuple):
    """What was told of a walk by one scale for everybody."""

    steps: int
    length_m: float


def pace(
    sources: list[str],
    /,
    *,
    walked: Annotated[float, Parameter(validator=validators.Number(gte=5.0, lte=1e4))],
    mount: Stepping = "chest",
    method: MethodName | None = None,
) -> int:
    """Tell the step scale of one wearer, by recordings of walks whose length is known.

    From standing to standing, and straight on if it can be: steady steps tell the scale, those at
    either end are taken to be as long. The longer the walk, and the oftener, the better: single
    ones of 20 m differ by some 4 %. It is for 'edge-agent run --step-scale'. Example: edge-agent
    pace csv:1.csv csv:2.csv --walked 50 --mount waist

    Parameters
    ----------
    sources
        Recordings of the same wearer, as --source of 'edge-agent run' has them.
    walked
        How many metres each walk was long.
    mount
        How the sensor was worn.
    method
        How it is read: robust, the default, or published.

    """
    console = Console(soft_wrap=True, highlight=False)
    told_m = []
    try:
        for source in sources:
            walk = _follow(source, mount, method)
            if not walk.length_m:
                raise ValueError(f"{source}: no step found: is the sensor worn as {mount}?")
            told_m.append(walk.length_m)
            console.print(
                f"{source}: {walk.steps} steps, {walk.length_m:.2f} m told, "
                f"scale {walked / walk.length_m:.3f}",
                markup=False,
            )
    except (SourceError, ConfigError, ValueError) as error:
        _log.error(str(error))
        return ExitCode.USAGE
    console.print(f"--step-scale {walked / float(np.mean(told_m)):.3f}")
    return ExitCode.OK


def _follow(source: str, mount: Stepping, method: MethodName | None) -> _Walk:
    follower = make_mount(mount, method)
    told = [
        step
        for sample in open_source(source, "r1", 0, mount).readings
        if isinstance(sample, ImuSample) and (step := follower.step(sample)) is not None
    ]
    told += follower.finish()
    return _Walk(sum(one.steps for one in told), steady_length_m(told, mount, arrives=True))
