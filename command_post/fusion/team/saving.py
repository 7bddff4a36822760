"""The team's log as bytes, for a tracker that is to go on elsewhere or later (pure)."""

from __future__ import annotations

import msgspec

from command_post.fusion.team.log import (
    Fix,
    Height,
    Installed,
    Peak,
    ResponderLog,
    Start,
    TeamLog,
)
from shared.messages import OdometryIncrement

VERSION = 2


class _SavedResponder(msgspec.Struct):
    starts: list[Start]
    moves: list[OdometryIncrement]
    peaks: list[Peak]
    nears: list[Peak]
    contacts: list[Peak]
    fixes: list[Fix]
    heights: list[Height]
    heard_ns: int
    near_ns: int | None


class _Saved(msgspec.Struct):
    version: int
    ticked_ns: int
    responders: dict[str, _SavedResponder]
    daps: dict[str, list[Installed]]
    dap_heights: dict[str, list[Height]]


def saved_log(log: TeamLog, ticked_ns: int) -> bytes:
    """Return all that was heard, and until when ticks had been made, as bytes."""
    responders = {
        name: _SavedResponder(
            each.starts, each.moves.messages(), each.peaks, each.nears, each.contacts,
            each.fixes, each.heights, each.heard_ns, each.near_ns,
        )
        for name, each in log.responders.items()
    }  # fmt: skip
    saved = _Saved(VERSION, ticked_ns, responders, log.daps, log.dap_heights)
    return msgspec.msgpack.encode(saved)


def loaded_log(saved: bytes) -> tuple[TeamLog, int]:
    """Return what ``saved_log`` was given. Raises ``ValueError`` for any other bytes."""
    try:
        told = msgspec.msgpack.decode(saved, type=_Saved)
    except msgspec.MsgspecError as error:
        raise ValueError(f"no saved tracker: {error}") from error
    if told.version != VERSION:
        raise ValueError(f"a tracker saved in version {told.version}; this reads {VERSION}")
    log = TeamLog()
    log.daps, log.dap_heights = told.daps, told.dap_heights
    for name, each in told.responders.items():
        of_one = log.responders[name] = ResponderLog(
            starts=each.starts, peaks=each.peaks, nears=each.nears, contacts=each.contacts,
            fixes=each.fixes, heights=each.heights, heard_ns=each.heard_ns, near_ns=each.near_ns,
        )  # fmt: skip
        for move in each.moves:
            of_one.moves.add(move)
    return log, told.ticked_ns
