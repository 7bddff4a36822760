"""As of when the post handles what it hears: time goes on, unless its clock is set back."""

from __future__ import annotations

from command_post.post_clock import PostClock
from shared.clock import ManualClock
from shared.units import NS_PER_S


def test_who_had_to_wait_for_their_turn_does_not_turn_time_back() -> None:
    own = ManualClock(20 * NS_PER_S)
    clock = PostClock(own, (), follows_exercise=False)
    came_s = [10, 20, 11, 20, 12]
    handled_ns = [clock.handled_at_ns(each * NS_PER_S) for each in came_s]
    assert handled_ns == [each * NS_PER_S for each in (10, 20, 20, 20, 20)]


def test_time_begins_anew_with_a_clock_that_is_set_back() -> None:
    own = ManualClock(1000 * NS_PER_S)
    clock = PostClock(own, (), follows_exercise=False)
    clock.handled_at_ns(own.now_ns())
    own.set_ns(5 * NS_PER_S)
    handled_ns = [clock.handled_at_ns(each * NS_PER_S) for each in (5, 6, 5)]
    assert handled_ns == [each * NS_PER_S for each in (1000, 6, 6)]
