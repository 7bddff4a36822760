"""``dap-node evaluate``: how near 'near' is, and what a real radio says of range."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Annotated, NamedTuple, TypeVar

import msgspec
import numpy as np
import structlog
from cyclopts import Parameter, validators
from rich.console import Console
from rich.progress import track

from dap_node.commands.nearness_report import nearness_object, print_nearness
from dap_node.commands.radio_report import Kind, kind_object, print_kind
from dap_node.comparison import compare
from dap_node.evaluation import LinkTrial, try_dap
from dap_node.measured import Measured, calibrated, offset_db, paced, read_measured
from dap_node.proximity import Method
from dap_node.radio_survey import survey, together
from dap_node.settings import DapSettings
from dap_node.survey_picture import draw_survey
from dap_node.true_range import PASS_M
from dap_node.walk_by import BEACON, try_receivers
from shared.config import checked, load_toml
from shared.exercise import seeds_in
from shared.files import check_can_write
from shared.process import ExitCode
from shared.simulation.scenario import load_scenario

Job = TypeVar("Job")

SUFFIXES = (".npz", ".csv", ".csv.gz")
"""What recordings are called."""

_log = structlog.stdlib.get_logger(__name__)


def evaluate(
    *what: str,
    seeds: str = "0-9",
    config: Path | None = None,
    method: Method | None = None,
    within: Annotated[float | None, Parameter(validator=validators.Number(gt=0.0))] = None,
    plot: Path | None = None,
    json: bool = False,
) -> int:
    """Measure how far from the DAP responders are when it tells of them.

    Of recordings also what the radio says of range, and how the likelihood does beside the
    published rule at the same rate of false alarms.

    Examples: dap-node evaluate four_daps --seeds 0-19;
    dap-node evaluate ../shared/data/rssi_walkby --plot radio.png

    Parameters
    ----------
    what
        A packaged scenario's name, or a TOML file; or recordings of a beacon carried by receivers
        (.npz) or of access points heard on a grid (.csv, .csv.gz): files, or folders of them.
    seeds
        Of a scenario: one seed, or the first and the last: 0-9.
    config
        TOML file as 'run' takes it. Recordings are brought to the usual scale by their own
        readings near by unless it gives an offset_db, or a model_of "beacon", and windows are made
        as long as their pace asks for unless it is given.
    method
        Rule by which nearness is told, in place of the configured one.
    within
        Who comes within so many metres passes the DAP: 1.5 if not given, but for the comparison of
        the rules, which goes by the range that is near.
    plot
        Draw signal strength and its variance against range into this PNG; of recordings only.
    json
        Print one JSON object, and no table.

    """
    try:
        settings = _settings(config, method, within)
        paths = [path for name in what for path in _recordings(Path(name))]
        if paths:
            return _evaluate_recordings(paths, settings, within, config, plot, json=json)
        if len(what) != 1:
            raise ValueError("give one scenario, or recordings: .npz files or folders of them")
        if plot is not None:
            raise ValueError("--plot draws recordings; give some, or leave it out")
        trials = _try_scenario(what[0], seeds, settings, within or PASS_M)
    except ValueError as error:
        _log.error(str(error))
        return ExitCode.USAGE
    title = f"{what[0]}, seeds {seeds}"
    if json:
        _write({**nearness_object(trials), "path_loss": None, "offset_db": settings.offset_db})
    else:
        print_nearness(Console(), title, trials, within or PASS_M)
    return ExitCode.OK


def _settings(config: Path | None, method: Method | None, within: float | None) -> DapSettings:
    settings = load_toml(config, DapSettings) if config else DapSettings()
    proximity = settings.proximity
    if method is not None:
        proximity = msgspec.structs.replace(proximity, method=method)
    if within is not None:
        near = msgspec.structs.replace(
            proximity.range,
            near_m=within,
            far_m=max(proximity.range.far_m, 2.0 * within),
            farthest_m=max(proximity.range.farthest_m, 3.0 * within),
        )
        proximity = msgspec.structs.replace(proximity, range=near)
    return checked(msgspec.structs.replace(settings, proximity=proximity))


def _recordings(path: Path) -> list[Path]:
    """Return the recordings that ``path`` names; none if it is a scenario."""
    if path.is_dir():
        found = sorted(one for one in path.iterdir() if one.name.endswith(SUFFIXES))
        if not found:
            raise ValueError(f"{path}: no .npz file in it, nor .csv; give a folder that has some")
        return found
    return [path] if path.name.endswith(SUFFIXES) else []


class _Read(NamedTuple):
    """What could be read, and of what could not, why."""

    recordings: list[Measured]
    failed: list[str]


def _read(paths: Sequence[Path]) -> _Read:
    """Read what can be; raise the first complaint if that is nothing."""
    recordings, failed = [], []
    for path in paths:
        try:
            recordings.append(read_measured(path))
        except ValueError as error:
            failed.append(str(error))
    if not recordings:
        raise ValueError(failed[0])
    return _Read(recordings, failed)


def _evaluate_recordings(
    paths: list[Path],
    settings: DapSettings,
    within: float | None,
    config: Path | None,
    plot: Path | None,
    *,
    json: bool,
) -> int:
    check_can_write(plot, "--plot")
    recordings, failed = _read(paths)
    by_kind: dict[str, list[Measured]] = {}
    for recording in recordings:
        by_kind.setdefault(recording.kind, []).append(recording)
    kinds = [
        _measure(every, settings if config else paced(settings, every), within)
        for every in _tracked(list(by_kind.values()))
    ]
    if plot is not None:
        draw_survey([each for kind in kinds for each in kind.surveys], plot)
    _show(kinds, failed, within or PASS_M, json=json)
    for complaint in failed:
        _log.error(complaint)
    return ExitCode.FAILURE if failed else ExitCode.OK


def _measure(every: list[Measured], settings: DapSettings, within: float | None) -> Kind:
    """Measure the recordings of one kind."""
    chance = np.random.default_rng(0)
    given_db = settings.offset_of_db(BEACON)
    added_db = given_db or offset_db(every)
    whole = msgspec.structs.replace(settings, offset_db=added_db, model_of={})
    near_m = settings.proximity.range.near_m
    return Kind(
        name=every[0].kind,
        surveys=[(one, survey(one.readings, chance)) for one in every],
        together=survey(together([one.readings for one in every]), chance),
        offset_db=added_db,
        near_m=near_m,
        comparison=compare(calibrated(every, given_db), settings.proximity, near_m),
        trials=[
            trial
            for one in every
            if one.walk is not None
            for trial in try_receivers(one.walk, whole, within or PASS_M)
        ],
    )


def _show(kinds: list[Kind], failed: list[str], pass_m: float, *, json: bool) -> None:
    trials = [trial for kind in kinds for trial in kind.trials]
    if json:
        first = kinds[0]
        fit = first.together.fit
        told: dict[str, object] = nearness_object(trials) if trials else {}
        told["path_loss"] = {
            "power_at_1_m_dbm": fit.power_at_1_m_dbm,
            "exponent": fit.exponent,
            "spread_db": fit.sigma_db,
        }
        told["offset_db"] = first.offset_db
        told["kinds"] = [kind_object(kind) for kind in kinds]
        _write({**told, "failed": failed})
        return
    console = Console()
    for kind in kinds:
        print_kind(console, kind)
        if kind.trials:
            names = ", ".join(one.name for one, _ in kind.surveys)
            print_nearness(console, names, kind.trials, pass_m)


def _try_scenario(name: str, seeds: str, settings: DapSettings, pass_m: float) -> list[LinkTrial]:
    scenario = load_scenario(name)
    jobs = [(dap_id, seed) for seed in seeds_in(seeds) for dap_id in scenario.daps]
    trials = [
        trial
        for dap_id, seed in _tracked(jobs)
        for trial in try_dap(scenario, dap_id, seed, settings, pass_m)
    ]
    if not trials:
        raise ValueError(f"{name}: no DAP to evaluate; give a scenario that has one")
    return trials


def _tracked(jobs: Sequence[Job]) -> Iterable[Job]:
    console = Console(stderr=True)
    return track(
        jobs, "measuring", console=console, transient=True, disable=not console.is_terminal
    )


def _write(told: dict[str, object]) -> None:
    sys.stdout.write(msgspec.json.encode(told).decode() + "\n")
