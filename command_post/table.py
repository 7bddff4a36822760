"""The roster on a terminal, 80 columns wide."""

from __future__ import annotations

from rich.box import SIMPLE_HEAD
from rich.table import Table
from rich.text import Text

from command_post.nodes.freshness import Freshness
from command_post.nodes.supplies import short_of
from command_post.roster import DapRow, OrderedRow, ResponderRow, Roster
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
    """Return the roster: responders, DAPs, other nodes of which there is a word, and remarks."""
    others = {(node.role, node.node_id): node for node in roster.nodes}
    table = Table(box=SIMPLE_HEAD, pad_edge=False, padding=(0, 1, 0, 0))
    table.add_column("", min_width=5, no_wrap=True)
    for heading in ("north m", "east m", "down m", "95 % m", "heard"):
        table.add_column(heading, justify="right", min_width=7, no_wrap=True)
    table.add_column("status", min_width=20)
    for responder in roster.responders:
        link = _link(others.pop(("responder", responder.responder_id), None), responder)
        status = _joined(*_responder_status(responder), *link)
        table.add_row(responder.responder_id, *_row(responder, status))
    table.add_section()
    for dap in roster.daps:
        link = _link(others.pop(("dap", dap.dap_id), None), dap)
        table.add_row(dap.dap_id, *_row(dap, _joined(_status(dap), *_fault(dap), *link)))
    table.add_section()
    for node in others.values():
        if node.words:
            words = Text("; ".join(node.words), "yellow")
            table.add_row(node.node_id, "", "", "", "", _age(node.heard_age_s), words)
    if roster.remarks:
        table.caption = Text("\n".join(roster.remarks), "bold yellow")
        table.caption_justify = "left"
    return table


def _link(node: Freshness | None, row: ResponderRow | DapRow) -> tuple[Text, ...]:
    """Return what is to be told of the link to a node, but for what its status tells."""
    if node is None:
        return ()
    silence = () if row.status == "lost" or node.silence is None else (node.silence,)
    return tuple(Text(words, "yellow") for words in (*silence, *node.words))


def _responder_status(row: ResponderRow) -> list[Text]:
    """Return what is to be known of a responder, in the order in which it matters."""
    parts = []
    if row.alarm is not None:
        style, stage = _ALARMS[row.alarm.phase]
        parts.append(Text(f"{row.alarm.kind.upper()}{stage}", style) + f": {row.alarm.reason}")
    parts += [_order(one) for one in row.orders]
    parts.append(_status(row))
    if row.activity is not None:
        parts.append(Text(row.activity))
    parts += [Text(words, "bold yellow") for words in short_of(row.supplies)]
    return [*parts, *_fault(row)]


def _order(one: OrderedRow) -> Text:
    """Return an order that was not acknowledged: what, for how long, and whether it is there."""
    kind = one.order.kind.replace("_", " ")
    urgent = one.order.kind == "evacuate"
    name = Text(kind.upper() if urgent else kind, "bold red" if urgent else "bold")
    stage = "received, not acknowledged" if one.received else "not received"
    said = f" {one.order.text!r}" if one.order.kind == "message" else ""
    return name + f"{said}: {stage} for {one.age_s:.0f} s"


def _fault(row: ResponderRow | DapRow) -> tuple[Text, ...]:
    return () if row.fault is None else (Text(row.fault, "yellow"),)


def _joined(*parts: Text) -> Text:
    return Text("; ").join(parts)


def _status(row: ResponderRow | DapRow) -> Text:
    return Text(row.status.replace("_", " "), _STYLES[row.status]) + Text(f": {row.reason}")


def _row(row: ResponderRow | DapRow, status: Text) -> tuple[str | Text, ...]:
    """Return place, the longer half-axis of the 95 % ellipse, age and status."""
    age = _age(row.heard_age_s)
    if row.position is None or row.radii95_m is None:
        return "", "", "", "", age, status
    position, radius_m = row.position, row.radii95_m[0]
    place = (position.north_m, position.east_m, position.down_m)
    return (*(f"{coordinate_m:.1f}" for coordinate_m in place), f"±{radius_m:.1f}", age, status)


def _age(age_s: float | None) -> str:
    return "" if age_s is None else f"{age_s:.0f} s"
