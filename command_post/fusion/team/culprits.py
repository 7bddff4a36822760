"""Which event a commit fails of, so that it alone is put aside (pure).

A commit that raises would raise again at every commit to come, as long as what it cannot bear is in
the log; and nobody of that crew would be solved any more. So the commit is tried as of earlier and
earlier times: the first event with which it fails is taken out of the log, if it does not fail
without.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from typing import NamedTuple, Protocol, TypeVar

from command_post.fusion.mishaps import GotOver
from command_post.fusion.team.log import END_OF_TIME_NS, ResponderLog, TeamLog
from command_post.fusion.team.move_log import MoveLog
from shared.topics import Role

MOST_AT_ONCE = 3
"""So many events may be to blame for one commit."""

_Result = TypeVar("_Result")


class Culprit(NamedTuple):
    """An event that was taken out of the log, in words, and whose it was."""

    role: Role
    node_id: str
    words: str


class _Timed(Protocol):
    @property
    def time_ns(self) -> int: ...


_T = TypeVar("_T", bound=_Timed)


def made_without(
    make: Callable[[int], _Result], log: TeamLog, of: TeamLog, since_ns: int, until_ns: int
) -> tuple[_Result, list[Culprit]] | None:
    """Return what ``make`` makes as of ``until_ns`` without what it fails of since ``since_ns``.

    That was taken out of ``log``, and of no responder and no DAP but those of the crew's log
    ``of``. ``None``, and nothing is taken out, if that is of no help.
    """
    responders, daps, dap_heights = dict(log.responders), dict(log.daps), dict(log.dap_heights)
    found: list[Culprit] = []
    for _ in range(MOST_AT_ONCE):
        at_ns = _first_failing(make, _times_ns(log, of, since_ns, until_ns))
        if at_ns is None:
            break
        found += _take_out(log, of, at_ns)
        if not _fails(make, until_ns):
            return make(until_ns), found
    log.responders, log.daps, log.dap_heights = responders, daps, dap_heights
    return None


def _first_failing(make: Callable[[int], object], times_ns: Sequence[int]) -> int | None:
    """Return the first time, of several in order, as of which ``make`` fails, if it is one."""
    if not times_ns or _fails(make, times_ns[0] - 1):
        return None
    at = bisect_right(range(len(times_ns)), False, key=lambda at: _fails(make, times_ns[at]))
    return times_ns[at] if at < len(times_ns) else None


def _fails(make: Callable[[int], object], until_ns: int) -> bool:
    # What it raises was told of when it failed first.
    with GotOver(lambda _: None):
        make(until_ns)
        return False
    return True


def _times_ns(log: TeamLog, of: TeamLog, since_ns: int, until_ns: int) -> list[int]:
    """Return when anything happened after ``since_ns`` and by ``until_ns``, in order."""
    found: set[int] = set()
    for name in of.responders:
        own = log.responders[name]
        found.update(own.moves.until(END_OF_TIME_NS).end_ns.tolist())
        of_one: tuple[Sequence[_Timed], ...] = (
            own.starts, own.peaks, own.nears, own.contacts, own.fixes, own.heights,
        )  # fmt: skip
        found.update(each.time_ns for events in of_one for each in events)
    for dap_id in of.daps:
        found.update(each.time_ns for each in log.daps[dap_id])
        found.update(each.time_ns for each in log.dap_heights.get(dap_id, ()))
    return sorted(time_ns for time_ns in found if since_ns < time_ns <= until_ns)


def _take_out(log: TeamLog, of: TeamLog, at_ns: int) -> list[Culprit]:
    """Take what happened at a time out of a log, which gets others of those whom it is of."""
    found: list[Culprit] = []
    for name in of.responders:
        own = log.responders[name]
        gone = _culprits(name, own, at_ns)
        if gone:
            found += gone
            log.responders[name] = replace(
                own, starts=_but(own.starts, at_ns), moves=_moves_but(own.moves, at_ns),
                peaks=_but(own.peaks, at_ns), nears=_but(own.nears, at_ns),
                contacts=_but(own.contacts, at_ns), fixes=_but(own.fixes, at_ns),
                heights=_but(own.heights, at_ns),
            )  # fmt: skip
    for dap_id in of.daps:
        if _at(log.daps[dap_id], at_ns):
            found.append(Culprit("dap", dap_id, "that it was set down"))
            log.daps[dap_id] = _but(log.daps[dap_id], at_ns)
        if _at(log.dap_heights.get(dap_id, ()), at_ns):
            found.append(Culprit("dap", dap_id, "how high it is"))
            log.dap_heights[dap_id] = _but(log.dap_heights[dap_id], at_ns)
    return found


def _culprits(name: str, own: ResponderLog, at_ns: int) -> list[Culprit]:
    found = [
        Culprit("dap", peak.other_id, f"that {name} passed")
        for peak in (*_at(own.peaks, at_ns), *_at(own.nears, at_ns))
    ]
    found += [
        Culprit("responder", name, f"that {name} met {met.other_id}")
        for met in _at(own.contacts, at_ns)
    ]
    ends_ns = own.moves.until(END_OF_TIME_NS).end_ns
    told = (
        ("a start", bool(_at(own.starts, at_ns))), ("a move", bool((ends_ns == at_ns).any())),
        ("where they are", bool(_at(own.fixes, at_ns))),
        ("how high they are", bool(_at(own.heights, at_ns))),
    )  # fmt: skip
    return found + [Culprit("responder", name, words) for words, is_one in told if is_one]


def _at(events: Iterable[_T], time_ns: int) -> list[_T]:
    return [each for each in events if each.time_ns == time_ns]


def _but(events: Iterable[_T], time_ns: int) -> list[_T]:
    return [each for each in events if each.time_ns != time_ns]


def _moves_but(moves: MoveLog, time_ns: int) -> MoveLog:
    kept = MoveLog()
    for each in moves.messages_until(END_OF_TIME_NS):
        if each.event_time_ns != time_ns:
            kept.add(each)
    return kept
