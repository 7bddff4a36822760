"""What may be wrong with a node, and the team's log as it would read if it were (pure)."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Literal, NamedTuple, TypeAlias, TypeVar

from msgspec import structs

from command_post.fusion.team.log import (
    ANYWHERE,
    END_OF_TIME_NS,
    Installed,
    Peak,
    ResponderLog,
    Start,
    TeamLog,
)
from shared.topics import Role
from shared.units import NS_PER_S

SuspicionKind: TypeAlias = Literal[
    "moved", "astray", "clock", "swapped", "renewed", "scale", "misplaced"
]

UNKNOWN_HEADING_SD_RAD = 100.0
SPELL_S = 60.0
"""So long before and after a place that GNSS had wrong it may have had all as wrong."""

_Timed = TypeVar("_Timed", Peak, Installed)


class Suspicion(NamedTuple):
    """Something that may be wrong since a time, on the clock of what was said.

    ``moved``: the DAP stands elsewhere. ``astray``: what the DAP tells means nothing. ``clock``:
    the node's clock is ahead by ``ahead_s``. ``swapped``: the radios of a responder and of
    ``other_id`` go by one another's name. ``renewed``: the responder's boot unit began anew and did
    not say so. ``scale``: its strides are too long or too short. ``misplaced``: it is not
    true where somebody said then that the responder was.
    """

    kind: SuspicionKind
    role: Role
    node_id: str
    since_ns: int
    other_id: str = ""
    ahead_s: float = 0.0


def supposed(log: TeamLog, suspicions: Sequence[Suspicion]) -> TeamLog:
    """Return the log as it would read if all those suspicions were right; ``log`` stays."""
    if not suspicions:
        return log
    supposing = TeamLog()
    supposing.responders = dict(log.responders)
    supposing.daps = dict(log.daps)
    supposing.dap_heights = log.dap_heights
    for suspicion in suspicions:
        _SUPPOSE[suspicion.kind](supposing, suspicion)
    return supposing


def clocks_ahead_ns(suspicions: Sequence[Suspicion]) -> dict[str, int]:
    """Return by how much the clocks of responders' units are held to be ahead, by responder.

    What comes of a log that supposes it is dated by those.
    """
    return {
        each.node_id: round(each.ahead_s * NS_PER_S)
        for each in suspicions
        if each.kind == "clock" and each.role == "responder"
    }


def _swap(log: TeamLog, suspicion: Suspicion) -> None:
    since_ns, one_id, other_id = suspicion.since_ns, suspicion.node_id, suspicion.other_id
    one, other = log.of(one_id), log.of(other_id)
    for own_id, own, others in ((one_id, one, other), (other_id, other, one)):
        log.responders[own_id] = replace(
            own,
            peaks=[*_before(own.peaks, since_ns), *_since(others.peaks, since_ns)],
            nears=[*_before(own.nears, since_ns), *_since(others.nears, since_ns)],
        )
    named = {one_id: other_id, other_id: one_id}
    for dap_id, installs in log.daps.items():
        log.daps[dap_id] = [
            each._replace(installer_id=named.get(each.installer_id or "", each.installer_id))
            if each.time_ns >= since_ns
            else each
            for each in installs
        ]


def _before(events: list[_Timed], time_ns: int) -> list[_Timed]:
    return events[: bisect_left(events, time_ns, key=lambda each: each.time_ns)]


def _since(events: list[_Timed], time_ns: int) -> list[_Timed]:
    return events[bisect_left(events, time_ns, key=lambda each: each.time_ns) :]


def _set_clock(log: TeamLog, suspicion: Suspicion) -> None:
    ahead_ns = round(suspicion.ahead_s * NS_PER_S)
    if suspicion.role == "dap":
        _set_clock_of_dap(log, suspicion.node_id, ahead_ns)
        return
    # What others say of the responder is put on the responder's own clock, which dates the moves.
    own = log.of(suspicion.node_id)
    log.responders[suspicion.node_id] = replace(
        own,
        peaks=[each._replace(time_ns=each.time_ns + ahead_ns) for each in own.peaks],
        nears=[each._replace(time_ns=each.time_ns + ahead_ns) for each in own.nears],
        fixes=[each._replace(time_ns=each.time_ns + ahead_ns) for each in own.fixes],
    )
    for dap_id, installs in log.daps.items():
        log.daps[dap_id] = [
            _dated(each, ahead_ns) if each.installer_id == suspicion.node_id else each
            for each in installs
        ]


def _set_clock_of_dap(log: TeamLog, dap_id: str, ahead_ns: int) -> None:
    def put_right(events: list[Peak]) -> list[Peak]:
        return sorted(
            each._replace(time_ns=each.time_ns - ahead_ns) if each.other_id == dap_id else each
            for each in events
        )

    _rewrite(log, put_right)
    log.daps[dap_id] = [_dated(each, -ahead_ns) for each in log.daps.get(dap_id, [])]


def _dated(installed: Installed, later_ns: int) -> Installed:
    said_ns = installed.time_ns if installed.said_ns is None else installed.said_ns
    return installed._replace(time_ns=installed.time_ns + later_ns, said_ns=said_ns)


def _withdraw(log: TeamLog, suspicion: Suspicion) -> None:
    def others(events: list[Peak]) -> list[Peak]:
        return [
            each
            for each in events
            if each.other_id != suspicion.node_id or each.time_ns < suspicion.since_ns
        ]

    _rewrite(log, others)


def _rewrite(log: TeamLog, rewritten: Callable[[list[Peak]], list[Peak]]) -> None:
    for responder_id, own in log.responders.items():
        log.responders[responder_id] = replace(
            own, peaks=rewritten(own.peaks), nears=rewritten(own.nears)
        )


def _set_down_again(log: TeamLog, suspicion: Suspicion) -> None:
    installs = log.daps[suspicion.node_id]
    before = _before(installs, suspicion.since_ns)
    if not before or before[-1].is_taken_up:
        return
    said_ns = before[-1].time_ns if before[-1].said_ns is None else before[-1].said_ns
    again = Installed(suspicion.since_ns, None, ANYWHERE, said_ns, found=True)
    log.daps[suspicion.node_id] = [*before, again, *installs[len(before) :]]


def _begin_anew(log: TeamLog, suspicion: Suspicion) -> None:
    own = log.of(suspicion.node_id)
    anew = Start(suspicion.since_ns, 0, UNKNOWN_HEADING_SD_RAD, None)
    _put_starts(log, suspicion.node_id, own, [*own.starts, anew])


def _loosen(log: TeamLog, suspicion: Suspicion) -> None:
    own = log.of(suspicion.node_id)
    loose = [each._replace(is_loose=True) for each in own.starts]
    _put_starts(log, suspicion.node_id, own, loose)


def _put_starts(log: TeamLog, responder_id: str, own: ResponderLog, starts: list[Start]) -> None:
    log.responders[responder_id] = replace(own, starts=sorted(starts, key=lambda each: each[:2]))


def _unplace(log: TeamLog, suspicion: Suspicion) -> None:
    """Forget where a responder was said to be then, and what each start said before they moved.

    And what GNSS said about then: a facade that reflects throws it off for as long as one is by.
    """
    own, since_ns = log.of(suspicion.node_id), suspicion.since_ns
    ends_ns = own.moves.until(END_OF_TIME_NS).end_ns
    after = int(ends_ns.searchsorted(since_ns, side="right"))
    until_ns = int(ends_ns[after]) if after < ends_ns.size else END_OF_TIME_NS
    starts = [
        each._replace(position=structs.replace(each.position, covariance_m2=ANYWHERE.covariance_m2))
        if each.position and each.down_sd_m is None and since_ns <= each.time_ns < until_ns
        else each
        for each in own.starts
    ]
    is_gnss = any(each.source == "gnss" and each.time_ns == since_ns for each in own.fixes)
    fixes = [
        each
        for each in own.fixes
        if each.time_ns != since_ns
        and not (
            is_gnss and each.source == "gnss" and abs(each.time_ns - since_ns) < SPELL_S * NS_PER_S
        )
    ]
    log.responders[suspicion.node_id] = replace(own, starts=starts, fixes=fixes)


_SUPPOSE: dict[SuspicionKind, Callable[[TeamLog, Suspicion], None]] = {
    "moved": _set_down_again,
    "astray": _withdraw,
    "clock": _set_clock,
    "swapped": _swap,
    "renewed": _begin_anew,
    "scale": _loosen,
    "misplaced": _unplace,
}
