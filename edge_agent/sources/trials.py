"""What there is to score a mount on: files, folders of them, and simulated exercises."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from edge_agent.evaluation.course_truth import MountTruth, StepCount
from edge_agent.evaluation.truth import Height, truth_of_stances
from edge_agent.mounts.methods import WITHOUT_GYRO, MountName
from edge_agent.sources.feet_trials import (
    Side,
    checked_by_feet,
    foot_beside,
    has_feet,
    trunk_between,
    whole_feet,
)
from edge_agent.sources.npz_set import read_npz_set
from edge_agent.sources.phone_export import METADATA, read_phone_export
from edge_agent.sources.recording import Recording, SourceError
from edge_agent.sources.simulated_wear import (
    refuse_unsimulated,
    simulate_worn,
    truth_of_trunk,
)
from edge_agent.sources.vehicle_trials import Lying, lyings_of, mounted_drive
from edge_agent.sources.vendor_csv import read_vendor_csv
from shared.simulation.scenario import Scenario, load_scenario
from shared.simulation.walker import simulate_walk
from shared.units import NS_PER_S

SIMULATED = "simulated:"


class TrialData(NamedTuple):
    """Samples in order, and what is known of the way, if anything is."""

    samples: Recording
    truth: MountTruth | None


class Trial(NamedTuple):
    """One recording or simulated walk. ``load`` raises ``SourceError`` if it cannot be used."""

    name: str
    group: str
    load: Callable[[], TrialData]


def find_trials(
    where: str, seed: int, mount: MountName = "boot", *, by_feet: bool = False
) -> list[Trial]:
    """Return the trials of a ``mount`` that ``where`` names, sorted by path.

    A file (``.npz`` or ``.csv``; a vehicle's is ``.npz``), a folder (all such files in it and
    below), a phone's export (``.zip``, or the folder with its ``metadata.csv``), or
    ``simulated:SCENARIO`` (each of its responders, walking as by ``seed``). A recording's group is
    its folder. Where sensors were on both feet each foot is a boot, and ``by_feet``, a waist's
    truth is where they were; what lacks samples of them is left out. Raises ``SourceError`` if
    there is nothing there, ``ConfigError`` for a scenario that cannot be used.
    """
    if where.startswith(SIMULATED):
        return _simulated(where.removeprefix(SIMULATED), seed, mount)
    path = Path(where)
    if not path.exists():
        raise SourceError(
            f"{where}: no such file; give a recording, a folder, or {SIMULATED}course"
        )
    if mount != "vehicle" and (path.suffix.lower() == ".zip" or (path / METADATA).is_file()):
        needs_gyro = mount not in WITHOUT_GYRO
        load = partial(_read_export, path, needs_gyro=needs_gyro)
        return [Trial(path.stem, path.resolve().parent.name, load)]
    files = sorted(path.rglob("*")) if path.is_dir() else [path]
    trials = [one for file in files for one in _of_file(file, mount, by_feet=by_feet)]
    if not trials:
        kinds = ".npz" if mount == "vehicle" else ".npz and no .csv"
        raise SourceError(f"{where}: no {kinds} recording there; give one")
    return trials


def _simulated(name: str, seed: int, mount: MountName) -> list[Trial]:
    """Return a trial for each responder of a scenario, walking as by ``seed``."""
    refuse_unsimulated(mount)
    scenario = load_scenario(name)
    group = f"simulated/{Path(name).stem}"
    return [
        Trial(
            f"{responder}/seed_{seed}",
            group,
            partial(_simulate, scenario, responder, seed, mount),
        )
        for responder in sorted(scenario.responders)
    ]


def _of_file(path: Path, mount: MountName, *, by_feet: bool) -> list[Trial]:
    """Return what a file has of a ``mount``: one trial, one for each foot or drive, or none."""
    if mount == "vehicle":
        return _drives(path) if path.suffix.lower() == ".npz" else []
    feet_tell = mount == "boot" or (mount == "waist" and by_feet)
    return _beside_feet(path, mount) if feet_tell and has_feet(path) else _of(path, mount)


def _of(path: Path, mount: MountName) -> list[Trial]:
    """Return the trial of one recording, if it is one."""
    reader = _reader(path, mount)
    group = path.resolve().parent.name
    return [] if reader is None else [Trial(path.stem, group, partial(reader, path))]


def _beside_feet(path: Path, mount: MountName) -> list[Trial]:
    """Return the trials whose truth are the feet of one recording."""
    group, sides = path.resolve().parent.name, whole_feet(path)
    if mount == "boot":
        return [
            Trial(f"{path.stem}/{side}", group, partial(_read_foot, path, side)) for side in sides
        ]
    return [Trial(path.stem, group, partial(_read_between, path))] if sides else []


def _read_foot(path: Path, side: Side) -> TrialData:
    return TrialData(*foot_beside(path, side))


def _read_between(path: Path) -> TrialData:
    return TrialData(*trunk_between(path))


def _drives(path: Path) -> list[Trial]:
    """Return the trials of one drive: as the phone was fixed, and as chance has it lie and slip."""
    group = path.resolve().parent.name
    try:
        lyings = lyings_of(path)
    except SourceError:
        return [Trial(path.stem, group, partial(_mount_drive, path, Lying(path.stem, 0, None)))]
    return [
        Trial(one.name, f"{group}/{one.lie or 'fixed'}", partial(_mount_drive, path, one))
        for one in lyings
    ]


def _mount_drive(path: Path, lying: Lying) -> TrialData:
    return TrialData(*mounted_drive(path, lying))


def _reader(path: Path, mount: MountName) -> Callable[[Path], TrialData] | None:
    match path.suffix.lower():
        case ".npz":
            return partial(_read_npz, needs_gyro=mount not in WITHOUT_GYRO)
        case ".csv":
            return _read_csv
    return None


def _read_npz(path: Path, *, needs_gyro: bool) -> TrialData:
    recording, truth = read_npz_set(path, needs_gyro=needs_gyro)
    if isinstance(truth, StepCount) and has_feet(path):
        truth = checked_by_feet(path, recording, truth)
    return TrialData(recording, truth)


def _read_export(path: Path, *, needs_gyro: bool) -> TrialData:
    return TrialData(read_phone_export(path, needs_gyro=needs_gyro), None)


def _read_csv(path: Path) -> TrialData:
    return TrialData(read_vendor_csv(path), None)


def _simulate(scenario: Scenario, responder: str, seed: int, mount: MountName) -> TrialData:
    read = simulate_worn(scenario, responder, seed, mount)
    walk = simulate_walk(scenario, responder, seed)
    time_ns = np.rint(read.time_s * NS_PER_S).astype(np.int64)
    recording = Recording(
        time_ns, read.force_m_s2, read.rate_rad_s, read.field_ut, read.pressure_pa
    )
    if mount != "boot":
        return TrialData(recording, truth_of_trunk(walk))
    position_m, _ = walk.foot.pose(read.time_s)
    truth = replace(
        truth_of_stances(walk.stance_time_s, walk.stance_position_m, scenario.taped_m),
        height=Height(read.time_s, position_m[:, 2]),
    )
    return TrialData(recording, truth)
