"""What the post counts of its own work at one moment, for those who watch it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

from command_post.incident import Incident
from command_post.reception import Reception
from command_post.recorder.backlog import RecorderStatus
from command_post.recorder.recording import Recorder
from command_post.roster import Roster
from shared.bus.fair_inbox import FairInbox
from shared.gate import Gate
from shared.units import NS_PER_S


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


def figures_of(
    roster: Roster, incident: Incident, gate: Gate, reception: Reception, inbox: FairInbox[Any],
    recorder: Recorder,
) -> Figures:  # fmt: skip
    """Return what all of them have counted by the time that ``roster`` is of."""
    return Figures(
        roster=roster,
        heard=reception.heard.copy(),
        turned_away=by_reason(gate.turned.items()),
        refused=by_reason(incident.refusals.items()),
        not_heard=by_reason(inbox.lost().items()),
        only_counted=reception.only_counted.total(),
        waiting=len(inbox),
        recorder=recorder.status(),
        fusion=incident.counts,
        estimate_ages_s={
            responder_id: (roster.now_ns - estimate.time_ns) / NS_PER_S
            for responder_id, estimate in incident.estimates.items()
        },
    )


def by_reason(counted: Iterable[tuple[tuple[str, str], int]]) -> Counter[str]:
    """Return counts by (reason, node), as a counter's items, summed over the nodes."""
    summed: Counter[str] = Counter()
    for (reason, _), count in counted:
        summed[reason] += count
    return summed
