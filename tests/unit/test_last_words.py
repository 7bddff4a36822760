"""When a post has all that its nodes had said."""

from __future__ import annotations

from command_post.last_words import LastWords
from shared.messages import Beat


def beat(last_number: int, acknowledged: int) -> Beat:
    return Beat(
        event_time_ns=0, sequence=0, run="0" * 16, last_number=last_number, kept_from=1,
        acknowledged=acknowledged,
    )  # fmt: skip


def test_nothing_is_known_of_who_has_not_been_heard() -> None:
    last_words = LastWords()
    assert last_words.are_safe([])
    last_words.hear("r1", beat(5, 5))
    assert last_words.are_safe(["r1"])
    assert not last_words.are_safe(["r1", "r2"])


def test_what_had_been_said_at_first_counts_and_not_what_is_said_since() -> None:
    last_words = LastWords()
    last_words.hear("r1", beat(9, 5))
    assert not last_words.are_safe(["r1"])
    last_words.hear("r1", beat(30, 8))
    assert not last_words.are_safe(["r1"])
    last_words.hear("r1", beat(40, 9))
    assert last_words.are_safe(["r1"])
