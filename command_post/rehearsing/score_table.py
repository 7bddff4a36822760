"""Score cards for people to read."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from rich.table import Table

from command_post.evaluation.naming import Harm, Naming
from command_post.evaluation.pooled import PooledMethod, RadiiIntervals, ScenarioScore, Vertical
from command_post.evaluation.score_card import Radii, Score

NOTHING = "none"
LEGEND = (
    "CE50, CE95: half and 95 % of the horizontal errors are within these. "
    "PDR alone: dead reckoning, without DAPs."
)


def score_table(score: Score) -> Table:
    """Return dead reckoning alone beside what the post said, for the team and each responder."""
    table = _table("Error against truth", "PDR alone", "Fused live")
    pdr, live = score.pdr, score.live
    _add(table, "absolute, CE50 / CE95", pdr.absolute, live.absolute)
    _add(table, "between responders, CE50 / CE95", pdr.pair_unturned, live.pair_unturned)
    _add(table, "team turned as one, CE50 / CE95", pdr.team, live.team)
    _add(table, "so turned, between responders", pdr.pair, live.pair)
    table.add_row("at the end, median", _metres(pdr.end_m), _metres(live.end_m))
    table.add_row("height, median", _metres(pdr.vertical_m), _metres(live.vertical_m))
    table.add_row("truth inside the 95 % region", "", _percent(score.coverage95_pct))
    table.add_section()
    for responder_id, each in score.responders.items():
        _add(table, f"{responder_id}, CE50 / CE95", each.pdr, each.live)
        table.add_row(
            f"{responder_id}, at the end", _metres(each.pdr_end_m), _metres(each.live_end_m)
        )
    table.add_section()
    for dap_id, error_m in (score.dap.each_m if score.dap else {}).items():
        table.add_row(f"{dap_id}, where it stands", "", _metres(error_m))
    return table


def pooled_table(name: str, score: ScenarioScore) -> Table:
    """Return the errors of all runs of a scenario, thrown together."""
    headings = ("PDR alone", "Fused live", "Afterwards")
    ways = [score.pdr, score.live] + ([] if score.after is None else [score.after])
    table = _table(
        f"{name}, {score.runs} runs, {score.daps_a_run:.1f} DAPs set down", *headings[: len(ways)]
    )

    def add(what: str, told: Callable[[PooledMethod], str]) -> None:
        table.add_row(what, *map(told, ways))

    add("absolute, CE50 / CE95", lambda way: _radii(way.absolute))
    add("  95 % interval of CE95", lambda way: _interval(way.intervals.absolute))
    add("between responders, CE50 / CE95", lambda way: _radii(way.pair_unturned))
    add("team turned as one, CE50 / CE95", lambda way: _radii(way.team))
    add("so turned, between responders", lambda way: _radii(way.pair))
    add("DAPs set down, CE50 / CE95", lambda way: _radii(way.dap))
    add("failed (95 % of a track over 10 m)", lambda way: _percent(way.fail_pct))
    add("truth inside the 95 % region", lambda way: _percent(way.coverage95_pct))
    add("told to be on a wrong floor", lambda way: _percent(way.wrong_floor_pct))
    add("height, 50 % / 95 %", lambda way: _height(way.vertical))
    for node_id, told in score.told.items():
        for what, each in told.items():
            table.add_row(f"{node_id}: {what}", "", f"{each.runs} runs, after {each.first_s:.0f} s")
    return table


def naming_table(name: str, told: Mapping[str, Naming]) -> Table:
    """Return what was named of what went wrong in a scenario, by mishap, and whom it harmed."""
    runs = max(each.runs for each in told.values())
    table = _table(
        f"{name}, runs: {runs}", "named", "after", "else told", "affected", "others", "DAPs off"
    )
    table.columns[0].min_width = max(map(len, told))
    for mishap, each in told.items():
        falsely = [f"{what} ({times})" for what, times in each.falsely.items()]
        otherwise = [f"otherwise ({each.otherwise})"] if each.otherwise else []
        table.add_row(
            mishap,
            f"{each.rightly} of {each.things}" if each.things else "",
            "" if each.after_s is None else f"{each.after_s:.0f} s",
            ", ".join(otherwise + falsely),
            *map(_harm, (each.affected, each.others, each.daps)),
        )
    return table


def _harm(harm: Harm) -> str:
    return "" if harm.wrong is None else f"{_short(harm.in_order)} → {_short(harm.wrong)}"


def _short(told: Radii | None) -> str:
    return NOTHING if told is None else f"{told.ce50_m:.1f}/{told.ce95_m:.1f}"


def _table(*headings: str) -> Table:
    table = Table(caption=LEGEND)
    table.add_column(headings[0])
    for heading in headings[1:]:
        table.add_column(heading, justify="right")
    return table


def _add(table: Table, what: str, pdr: Radii | None, live: Radii | None) -> None:
    table.add_row(what, _radii(pdr), _radii(live))


def _radii(radii: Radii | None) -> str:
    return NOTHING if radii is None else f"{radii.ce50_m:.2f} / {radii.ce95_m:.2f} m"


def _interval(radii: RadiiIntervals | None) -> str:
    return NOTHING if radii is None else "{:.2f} to {:.2f} m".format(*radii.ce95_m)


def _height(height: Vertical | None) -> str:
    return NOTHING if height is None else f"{height.p50_m:.2f} / {height.p95_m:.2f} m"


def _metres(value_m: float | None) -> str:
    return NOTHING if value_m is None else f"{value_m:.2f} m"


def _percent(value_pct: float | None) -> str:
    return NOTHING if value_pct is None else f"{value_pct:.1f} %"
