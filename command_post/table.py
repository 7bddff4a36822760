"""The roster on a terminal."""

from __future__ import annotations

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from command_post.roster import DapRow, ResponderRow, Roster
from shared.messages import LocalPosition

_STYLES = {
    "tracking": "green",
    "installed": "green",
    "dead_reckoning": "yellow",
    "not_installed": "yellow",
    "no_track": "yellow",
    "lost": "bold red",
}


def roster_table(roster: Roster) -> RenderableType:
    """Return the roster as tables of responders and DAPs."""
    responders = _table("Responder", "Heard", "DAP near")
    for row in roster.responders:
        ages = _age(row.heard_age_s), _age(row.proximity_age_s)
        responders.add_row(row.responder_id, *_place(row), *ages, *_status(row))
    daps = _table("DAP", "Heard", "Set down by")
    for dap in roster.daps:
        daps.add_row(
            dap.dap_id, *_place(dap), _age(dap.heard_age_s), dap.installer_id or "", *_status(dap)
        )
    return Group(responders, daps)


def _table(who: str, *ages: str) -> Table:
    table = Table(expand=False)
    table.add_column(who, min_width=9)
    for heading in ("North m", "East m", "Down m", "95 % m"):
        table.add_column(heading, justify="right", min_width=7)
    for heading in ages:
        table.add_column(heading, justify="right", min_width=8)
    table.add_column("Status", min_width=14)
    table.add_column("Why")
    return table


def _place(row: ResponderRow | DapRow) -> tuple[str, str, str, str]:
    """Return north, east, down and the longer half-axis of the 95 % ellipse."""
    position: LocalPosition | None = row.position
    if position is None or row.radii95_m is None:
        return "", "", "", ""
    return (
        f"{position.north_m:.1f}",
        f"{position.east_m:.1f}",
        f"{position.down_m:.1f}",
        f"±{row.radii95_m[0]:.1f}",
    )


def _age(age_s: float | None) -> str:
    return "" if age_s is None else f"{age_s:.0f} s"


def _status(row: ResponderRow | DapRow) -> tuple[Text, str]:
    return Text(row.status.replace("_", " "), _STYLES[row.status]), row.reason
