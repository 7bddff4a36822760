"""Score cards for people to read."""

from __future__ import annotations

from rich.table import Table

from command_post.evaluation import (
    PooledLive,
    PooledMethod,
    Radii,
    ScenarioScore,
    Score,
)

NOTHING = "none"


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
    table.add_row("truth inside the 95 % ellipse", "", _percent(score.coverage95_pct))
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
    table = _table(f"{name}, {score.runs} runs", "PDR alone", "Fused live")
    pdr: PooledMethod = score.pdr
    live: PooledLive = score.live
    _add(table, "absolute, CE50 / CE95", pdr.absolute, live.absolute)
    _add(table, "between responders, CE50 / CE95", pdr.pair_unturned, live.pair_unturned)
    _add(table, "team turned as one, CE50 / CE95", pdr.team, live.team)
    _add(table, "so turned, between responders", pdr.pair, live.pair)
    _add(table, "DAPs set down, CE50 / CE95", None, live.dap)
    table.add_row(
        "failed (95 % of a track over 10 m)", *map(_percent, (pdr.fail_pct, live.fail_pct))
    )
    table.add_row("truth inside the 95 % ellipse", "", _percent(live.coverage95_pct))
    return table


def _table(*headings: str) -> Table:
    table = Table()
    table.add_column(headings[0])
    for heading in headings[1:]:
        table.add_column(heading, justify="right")
    return table


def _add(table: Table, what: str, pdr: Radii | None, live: Radii | None) -> None:
    table.add_row(what, _radii(pdr), _radii(live))


def _radii(radii: Radii | None) -> str:
    return NOTHING if radii is None else f"{radii.ce50_m:.2f} / {radii.ce95_m:.2f} m"


def _metres(value_m: float | None) -> str:
    return NOTHING if value_m is None else f"{value_m:.2f} m"


def _percent(value_pct: float | None) -> str:
    return NOTHING if value_pct is None else f"{value_pct:.1f} %"
