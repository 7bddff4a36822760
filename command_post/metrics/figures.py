"""What the post counts of its own work at one moment, for those who watch it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from typing import NamedTuple

from command_post.recorder.backlog import RecorderStatus
from command_post.roster import Roster


class Figures(NamedTuple):
    """Counts since the post began, unless they say otherwise.

    ``heard`` are the messages that were let in, by topic. ``turned_away`` counts by the gate's
    reason, ``refused`` by the incident's, ``not_heard`` by the inbox's; ``only_counted`` is what
    was too much of it to be kept. ``waiting`` is in the inbox now, ``fusion`` what the fusion tells
    of itself, ``estimate_ages_s`` how old each responder's newest estimate is.
    """

    roster: Roster
    heard: Mapping[str, int]
    turned_away: Mapping[str, int]
    refused: Mapping[str, int]
    not_heard: Mapping[str, int]
    only_counted: int
    waiting: int
    recorder: RecorderStatus
    fusion: Mapping[str, int]
    estimate_ages_s: Mapping[str, float]


def by_reason(counted: Iterable[tuple[tuple[str, str], int]]) -> Counter[str]:
    """Return counts by (reason, node), as a counter's items, summed over the nodes."""
    summed: Counter[str] = Counter()
    for (reason, _), count in counted:
        summed[reason] += count
    return summed
