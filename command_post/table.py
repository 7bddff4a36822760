"""The roster on a terminal, 80 columns wide."""

from __future__ import annotations

from rich.box import SIMPLE_HEAD
from rich.table import Table
from rich.text import Text

from command_post.roster import DapRow, ResponderRow, Roster
from shared.messages import AlarmPhase

_STYLES = {
    "tracking": "green",
    "installed": "green",
    "dead_reckoning": "yellow",
    "not_installed": "yellow",
    "no_track": "yellow",
    "lost": "bold red",
}

_ALARMS: dict[AlarmPhase, tuple[str, str]] = {
    "alarm": ("bold white on red", ""),
    "pre_alarm": ("bold red", " soon"),
}
"""Of an alarm that stands: its style, and what is added to its name."""


def roster_table(roster: Roster) -> Table:
    """Return the roster: responders, then DAPs."""
    table = Table(box=SIMPLE_HEAD, pad_edge=False, padding=(0, 1, 0, 0))
    table.add_column("", min_width=5, no_wrap=True)
    for heading in ("north m", "east m", "down m", "95 % m", "heard"):
        table.add_column(heading, justify="right", min_width=7, no_wrap=True)
    table.add_column("status", min_width=20)
    for responder in roster.responders:
        table.add_row(responder.responder_id, *_row(responder, _responder_status(responder)))
    table.add_section()
    for dap in roster.daps:
        table.add_row(dap.dap_id, *_row(dap, _joined(_status(dap), *_fault(dap))))
    return table


def _responder_status(row: ResponderRow) -> Text:
    """Return what is to be known of a responder, in the order in which it matters."""
    parts = []
    if row.alarm is not None:
        style, stage = _ALARMS[row.alarm.phase]
        parts.append(Text(f"{row.alarm.kind.upper()}{stage}", style) + f": {row.alarm.reason}")
    parts.append(_status(row))
    if row.activity is not None:
        parts.append(Text(row.activity))
    return _joined(*parts, *_fault(row))


def _fault(row: ResponderRow | DapRow) -> tuple[Text, ...]:
    return () if row.fault is None else (Text(row.fault, "yellow"),)


def _joined(*parts: Text) -> Text:
    return Text("; ").join(parts)


def _status(row: ResponderRow | DapRow) -> Text:
    return Text(row.status.replace("_", " "), _STYLES[row.status]) + Text(f": {row.reason}")


def _row(row: ResponderRow | DapRow, status: Text) -> tuple[str | Text, ...]:
    """Return place, the longer half-axis of the 95 % ellipse, age and status."""
    age = "" if row.heard_age_s is None else f"{row.heard_age_s:.0f} s"
    if row.position is None or row.radii95_m is None:
        return "", "", "", "", age, status
    position, radius_m = row.position, row.radii95_m[0]
    place = (position.north_m, position.east_m, position.down_m)
    return (*(f"{coordinate_m:.1f}" for coordinate_m in place), f"±{radius_m:.1f}", age, status)
