"""A post that is to stop handles what is heard for a while, and no longer."""

from __future__ import annotations

from threading import Event

from command_post.last_messages import LastMessages


def test_it_is_over_so_long_after_it_was_asked_to_stop_and_not_before() -> None:
    now_s, stop = 0.0, Event()
    last = LastMessages(stop, 0.5, lambda: now_s)
    assert not last.is_over
    now_s = 100.0
    stop.set()
    assert not last.is_over
    now_s = 100.4
    assert not last.is_over
    now_s = 100.5
    assert last.is_over
