"""Drives to score a vehicle's mount on: as recorded, and with the phone lying and slipping anyhow.

A drive is a recording of a sensor fixed to the car, forward-right-down, with the car's own speed.
"""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import numpy as np

from edge_agent.evaluation.course_truth import DrivenSpeed, FixedDrive, MountedDrive
from edge_agent.evaluation.vehicle_mountings import Lie, mounted
from edge_agent.sources.npz_set import read_npz_set
from edge_agent.sources.recording import Recording, SourceError
from shared.simulation.chance import generator
from shared.units import NS_PER_S

MOUNTINGS = 50
PIECE_S = 60.0
"""Longer drives are cut into pieces; mountings take turns with them."""

SLIPPING_S = 25.0
"""In a shorter drive there is no time to slip three times."""

STEADY_RAD_S = 0.5
"""Half of the time a car turns less, on any road: some 0.02, which is 1.2 in degrees."""

BEYOND_S = 0.1
"""Samples further from the first or the last true speed are not of the drive."""


@lru_cache(maxsize=8)
def pieces_of(path: Path) -> tuple[FixedDrive, ...]:
    """Return the drive at ``path`` in pieces of ``PIECE_S``; raise ``SourceError`` if it is none.

    What is left over, if it is shorter than half of a piece, is part of the last.
    """
    recording, truth = read_npz_set(path)
    if not isinstance(truth, DrivenSpeed):
        raise SourceError(f"{path}: no speed of a vehicle in it: truth_t_s and truth_speed_m_s")
    turning_rad_s = np.nanmedian(np.linalg.norm(recording.rate_rad_s, axis=1))
    if turning_rad_s > STEADY_RAD_S:
        raise SourceError(
            f"{path}: gyr_rad_s mostly reads {turning_rad_s:.2g}, more than a car turns: is it in "
            "°/s?"
        )
    time_s = recording.time_ns / NS_PER_S
    known = (time_s > truth.time_s[0] - BEYOND_S) & (time_s < truth.time_s[-1] + BEYOND_S)
    if np.count_nonzero(known) < 2:
        raise SourceError(f"{path}: truth_t_s is of another time than the samples")
    recording, time_s = recording.rows(np.flatnonzero(known)), time_s[known]
    count = max(1, round(float(time_s[-1] - time_s[0]) / PIECE_S))
    bounds_s = time_s[0] + PIECE_S * np.arange(count)
    piece_of = np.searchsorted(bounds_s, time_s, side="right") - 1
    return tuple(
        FixedDrive(recording.rows(np.flatnonzero(piece_of == piece)), truth)
        for piece in range(count)
    )


class Lying(NamedTuple):
    """A trial: which piece of a drive, how the phone lies (``None``: as fixed), by which seed."""

    name: str
    piece: int
    lie: Lie | None
    seed: int = 0


def lyings_of(path: Path) -> list[Lying]:
    """Return the trials of the drive at ``path``; raise ``SourceError`` if it is none.

    In the first half of the mountings the phone is only tilted, in the others it lies anyhow. A
    drive too short to slip in is scored as it was recorded alone.
    """
    pieces = pieces_of(path)
    count = len(pieces)
    lies: tuple[Lie, Lie] = ("tilted", "any")
    fixed = [Lying(f"{path.stem}/piece_{piece}", piece, None) for piece in range(count)]
    if min(np.ptp(piece.samples.time_ns) for piece in pieces) < SLIPPING_S * NS_PER_S:
        return fixed
    return fixed + [
        Lying(f"{path.stem}/seed_{seed}", seed % count, lies[2 * seed // MOUNTINGS], seed)
        for seed in range(MOUNTINGS)
    ]


def mounted_drive(path: Path, lying: Lying) -> tuple[Recording, MountedDrive]:
    """Return what the phone reads that lies so in the drive at ``path``, and the truth."""
    fixed = pieces_of(path)[lying.piece]
    if lying.lie is None:
        return fixed.samples, MountedDrive(fixed, ())
    chance = generator(lying.seed, "mounting", lying.lie, path.stem)
    made = mounted(fixed.samples, lying.lie, chance)
    return made.recording, MountedDrive(fixed, made.slips)
