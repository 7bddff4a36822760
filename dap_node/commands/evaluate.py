"""``dap-node evaluate``: how near 'near' is."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Annotated, NamedTuple, TypeVar

import msgspec
import structlog
from cyclopts import Parameter, validators
from rich.console import Console
from rich.progress import track
from rich.table import Table

from dap_node.evaluation import LinkTrial, ProximityScore, score, try_dap
from dap_node.peak_score import BIN_DB, FALSE_M, STRONG_DBM, PeakScore, score_peaks
from dap_node.settings import DapSettings
from dap_node.true_range import PASS_M
from dap_node.walk_by import try_receivers
from shared.config import load_toml
from shared.exercise import seeds_in
from shared.process import ExitCode
from shared.simulation.scenario import load_scenario
from shared.walk_by import PathLoss, calibration_db, path_loss, read_walk_by

Job = TypeVar("Job")

_log = structlog.stdlib.get_logger(__name__)


def evaluate(
    *what: str,
    seeds: str = "0-9",
    config: Path | None = None,
    within: Annotated[float, Parameter(validator=validators.Number(gt=0.0))] = PASS_M,
    json: bool = False,
) -> int:
    """Measure how far from the DAP responders are when it tells of them.

    Examples: dap-node evaluate four_daps --seeds 0-19;
    dap-node evaluate ../shared/data/rssi_walkby --config beacon.toml

    Parameters
    ----------
    what
        A packaged scenario's name, or a TOML file; or recordings of a beacon carried by receivers,
        .npz files or folders of them.
    seeds
        Of a scenario: one seed, or the first and the last: 0-9.
    config
        TOML file with offset_db, [proximity] and [peaks]. Recordings are brought to the usual
        scale by their own readings near by, unless it gives an offset_db.
    within
        Who comes within so many metres passes the DAP.
    json
        Print one JSON object, and no table.

    """
    try:
        settings = load_toml(config, DapSettings) if config else DapSettings()
        paths = [path for name in what for path in _recordings(Path(name))]
        if paths:
            told = _try_recordings(paths, settings, within)
        elif len(what) == 1:
            told = _try_scenario(what[0], seeds, settings, within)
        else:
            raise ValueError("give one scenario, or recordings: .npz files or folders of them")
    except ValueError as error:
        _log.error(str(error))
        return ExitCode.USAGE
    _show(told, within, json=json)
    return ExitCode.OK


class _Told(NamedTuple):
    """What was tried, and how it went; of recordings also how power falls, and what was added."""

    title: str
    trials: list[LinkTrial]
    fit: PathLoss | None = None
    offset_db: float = 0.0


def _recordings(path: Path) -> list[Path]:
    """Return the recordings that ``path`` names; none if it is a scenario."""
    if path.is_dir():
        found = sorted(path.glob("*.npz"))
        if not found:
            raise ValueError(f"{path}: no .npz file in it; give a folder that has some")
        return found
    return [path] if path.suffix == ".npz" else []


def _try_recordings(paths: list[Path], settings: DapSettings, pass_m: float) -> _Told:
    recordings = [read_walk_by(path) for path in paths]
    offset_db = settings.offset_db or calibration_db(recordings)
    calibrated = msgspec.structs.replace(settings, offset_db=offset_db)
    trials = [
        trial for one in _tracked(recordings) for trial in try_receivers(one, calibrated, pass_m)
    ]
    names = ", ".join(path.stem for path in paths)
    return _Told(names, trials, path_loss(recordings), offset_db)


def _try_scenario(name: str, seeds: str, settings: DapSettings, pass_m: float) -> _Told:
    scenario = load_scenario(name)
    jobs = [(dap_id, seed) for seed in seeds_in(seeds) for dap_id in scenario.daps]
    trials = [
        trial
        for dap_id, seed in _tracked(jobs)
        for trial in try_dap(scenario, dap_id, seed, settings, pass_m)
    ]
    if not trials:
        raise ValueError(f"{name}: no DAP to evaluate; give a scenario that has one")
    return _Told(f"{name}, seeds {seeds}", trials, None, settings.offset_db)


def _tracked(jobs: Sequence[Job]) -> Iterable[Job]:
    console = Console(stderr=True)
    return track(
        jobs, "measuring", console=console, transient=True, disable=not console.is_terminal
    )


def _show(told: _Told, pass_m: float, *, json: bool) -> None:
    near, peaks = score(told.trials), score_peaks(trial.peaks for trial in told.trials)
    if json:
        sys.stdout.write(msgspec.json.encode(_as_object(told, near, peaks)).decode() + "\n")
        return
    console = Console()
    if told.fit is not None:
        console.print(
            f"power at 1 m {told.fit.power_at_1_m_dbm:.1f} dBm, exponent {told.fit.exponent:.2f}, "
            f"spread {told.fit.spread_db:.1f} dB; {told.offset_db:+.1f} dB added",
            highlight=False,
        )
    console.print(_proximity_table(told.title, near, pass_m))
    console.print(_peak_table("peaks", peaks, pass_m))
    console.print(_range_table("range at the peak", peaks))


def _as_object(told: _Told, near: ProximityScore, peaks: PeakScore) -> dict[str, object]:
    return {
        "proximity": near._asdict(),
        "peaks": {**peaks._asdict(), "bins": [one._asdict() for one in peaks.bins]},
        "path_loss": None if told.fit is None else told.fit._asdict(),
        "offset_db": told.offset_db,
    }


def _proximity_table(title: str, told: ProximityScore, pass_m: float) -> Table:
    table = Table("", "", title=title, show_header=False)
    table.add_row(f"passes within {pass_m:g} m", f"{told.passes}")
    table.add_row("of these noticed", f"{told.noticed}")
    table.add_row("stays told", f"{told.stays}")
    table.add_row(
        "entering at, median, 95 %", f"{told.entered_p50_m:.1f} m, {told.entered_p95_m:.1f} m"
    )
    table.add_row("events told", f"{told.events}")
    table.add_row(
        "at, median, 90 %, 95 %", f"{told.p50_m:.1f} m, {told.p90_m:.1f} m, {told.p95_m:.1f} m"
    )
    table.add_row("beyond 3 m, 5 m", f"{told.beyond_3_m:.1%}, {told.beyond_5_m:.1%}")
    return table


def _peak_table(title: str, told: PeakScore, pass_m: float) -> Table:
    table = Table("", "", title=title, show_header=False)
    table.add_row(f"passes within {pass_m:g} m", f"{told.passes}")
    table.add_row("with a peak, peaks in them", f"{told.noticed}, {told.in_passes}")
    table.add_row(
        "after the nearest by, median, 95 % either way",
        f"{told.off_p50_s:+.2f} s, {told.off_abs_p95_s:.2f} s",
    )
    table.add_row("told after, median", f"{told.delay_p50_s:.1f} s")
    table.add_row("peaks told", f"{told.peaks}")
    table.add_row(
        f"from {STRONG_DBM:.0f} dBm, of these beyond {FALSE_M:g} m",
        f"{told.strong}, {told.strong_false}",
    )
    return table


def _range_table(title: str, told: PeakScore) -> Table:
    table = Table(
        "peak, dBm", "peaks", "median, m", "95 %, m", "σ, m", "σ by median, m", title=title
    )
    for one in told.bins:
        table.add_row(
            f"{one.from_dbm} to {one.from_dbm + BIN_DB}",
            f"{one.peaks}",
            *(f"{value:.2f}" for value in one[2:]),
        )
    return table
