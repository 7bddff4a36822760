"""What is heard of somebody while nobody knows where they went (pure).

Their unit tells nothing, and DAPs, others or a commander still tell of them. That they stood there
says nothing against where they were known to be last, nor against whom they met: in between they
may have walked as who is silent may.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from command_post.fusion.team.log import ResponderLog
from command_post.fusion.team.move_log import Floats, Ints, Moves
from command_post.fusion.team.settings import TeamSettings
from command_post.fusion.team.silences import least_quiet_ns, unheard_m
from shared.units import NS_PER_S


class Unheard(NamedTuple):
    """When others told of somebody (k,), and how far they may have gone since seen before (m)."""

    time_ns: Ints
    gone_m: Floats


NOTHING_UNHEARD = Unheard(np.empty(0, np.int64), np.empty(0))


def unheard_of(
    log: ResponderLog, seen_ns: Ints, begin_ns: Ints, told_ns: Ints, until_ns: int,
    settings: TeamSettings,
) -> Unheard:  # fmt: skip
    """Return when others told of somebody, as of ``until_ns``, who may not stand where seen before.

    ``seen_ns`` is when each stance of theirs is reached, from where they set out at ``begin_ns``;
    others told of them at ``told_ns``.
    """
    quiet_ns = least_quiet_ns(settings)
    at = np.searchsorted(seen_ns, told_ns, side="right")
    on_way = np.append(begin_ns, until_ns + 1)[at] < told_ns
    maybe = (at > 0) & ~on_way & (told_ns - seen_ns[at - 1] > quiet_ns)
    quiet_ns = quiet_ns if log.beat_s is not None else round(settings.silence_s * NS_PER_S)
    found: list[int] = []
    gone_m: list[float] = []
    for time_ns in np.unique(told_ns[maybe]).tolist():
        known_ns = log.known.by(time_ns)
        if time_ns - known_ns > quiet_ns and not _stood(log, time_ns, until_ns):
            last_ns = int(seen_ns[np.searchsorted(seen_ns, time_ns, side="right") - 1])
            last_ns = max([last_ns, known_ns, *found[-1:]])
            silent_s, unseen_s = (time_ns - known_ns) / NS_PER_S, (time_ns - last_ns) / NS_PER_S
            found.append(time_ns)
            gone_m.append(unheard_m(silent_s, unseen_s, log, settings))
    return Unheard(np.array(found, np.int64), np.array(gone_m))


def _stood(log: ResponderLog, time_ns: int, until_ns: int) -> bool:
    """Whether their unit has told by ``until_ns`` that they stood at ``time_ns``.

    That is so once it tells anything of later, unless it began anew before the next stride that it
    tells, or some before that are lost.
    """
    again = next(log.known.after(time_ns), None)
    if again is None or again.begin_ns > until_ns:
        return False
    moves = log.moves.until(until_ns)
    after = int(np.searchsorted(moves.end_ns, time_ns, side="right"))
    is_last = after == moves.end_ns.size
    next_ns = until_ns if is_last else int(moves.end_ns[after])
    if any(time_ns < start.time_ns <= next_ns for start in log.starts):
        return False
    return is_last or after == 0 or bool(moves.sequence[after] <= moves.sequence[after - 1] + 1)


def lost_since_m2(lost_m2: Floats, moves: Moves, unheard: Unheard) -> Floats:
    """Return the variance of the way lost before each of ``moves`` (m,), since others told of them.

    ``lost_m2`` (m,) is that of all that was lost since the move before: it is in the strides that
    were lost, which are as many as there was time for.
    """
    since_m2 = lost_m2.copy()
    after = np.searchsorted(moves.end_ns, unheard.time_ns, side="right")
    for move, time_ns in zip(after.tolist(), unheard.time_ns.tolist(), strict=True):
        if 0 < move < since_m2.size:
            begin_ns, before_ns = int(moves.start_ns[move]), int(moves.end_ns[move - 1])
            share = (begin_ns - time_ns) / max(begin_ns - before_ns, 1)
            since_m2[move] = share * share * lost_m2[move]
    return since_m2
