"""When the table of stations is said."""

from __future__ import annotations

from command_post.station_notice import LEAST_PAUSE_S, REPEAT_S, StationNotice
from shared.messages import StationTable

TABLE = StationTable(
    event_time_ns=0, sequence=0, responders=(("02:00:5e:10:00:01", "r1"),), daps=()
)


def said(notice: StationNotice, real_s: float, *, some_came: bool = False) -> int | None:
    table = notice.due(real_s, round(real_s * 1e9), some_came=some_came)
    assert table is None or table.responders == TABLE.responders
    return None if table is None else table.sequence


def test_it_is_said_at_first_and_every_half_minute() -> None:
    notice = StationNotice(TABLE)
    assert [said(notice, at_s) for at_s in (5.0, 6.0, 5.0 + REPEAT_S)] == [0, None, 1]


def test_all_who_come_at_once_are_told_together_and_soon() -> None:
    notice = StationNotice(TABLE)
    assert said(notice, 0.0) == 0
    assert said(notice, 0.5, some_came=True) is None
    assert said(notice, 1.0, some_came=True) is None
    assert said(notice, LEAST_PAUSE_S) == 1
    assert said(notice, 2.0 * LEAST_PAUSE_S) is None


def test_without_a_table_nothing_is_said() -> None:
    assert said(StationNotice(None), 0.0, some_came=True) is None
