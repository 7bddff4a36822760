"""What does it cost everybody else that one stride comes an hour late? Without any network.

``python -m tests.faults.late_message --responders 12 --minutes 20 --late 19`` has the post's
incident handle what so many responders say who walk for so long, a stride a second each, but for
one stride, which comes when it is ``late`` minutes old; then all walk on for ``--after`` minutes.
It prints as JSON how long handling a message took before and since, in seconds of a core (median,
99th percentile, longest), and how much of the time since was worked. ``--at-once`` has all that the
stride makes wrong made anew at once, for comparison.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np

from command_post.fusion.methods import prepare_fusion
from command_post.fusion.team import lines
from command_post.incident import Incident
from command_post.incident_settings import IncidentSettings
from shared.codec import encode
from shared.messages import OdometryIncrement
from shared.topics import Key
from shared.units import NS_PER_S
from tests.benchmarks.crowd import Said, crowd
from tests.benchmarks.test_team_speed import role_of, topic_of

CREW = 12
NS_PER_MIN = 60 * NS_PER_S
ON_THE_WAY_NS = NS_PER_S // 50


class Took(NamedTuple):
    """How long handling one message took, in seconds of a core, and all together."""

    median_s: float
    p99_s: float
    longest_s: float
    share: float


def handled(incident: Incident, said: Iterable[Said], now_ns: int = 0) -> Iterator[float]:
    """Have the incident handle what is ``said``, not before ``now_ns``; yield what each took."""
    name = incident.settings.incident
    for node_id, message in said:
        now_ns = max(now_ns, message.event_time_ns + ON_THE_WAY_NS)
        key = str(Key(name, role_of(message), node_id, topic_of(message)))
        payload, began_s = encode(message), time.process_time()
        incident.handle(key, payload, now_ns)
        yield time.process_time() - began_s


def summed_up(took_s: Iterable[float], minutes: float) -> Took:
    """Return what it took in all, in so many minutes of the incident."""
    each_s = np.array(list(took_s))
    figures = (np.median(each_s), np.quantile(each_s, 0.99), each_s.max())
    share = each_s.sum() / (60.0 * minutes)
    return Took(*(round(float(each), 4) for each in (*figures, share)))


def one_is_late(responders: int, minutes: float, late: float, after: float) -> dict[str, Took]:
    """Return what it took before one stride that is ``late`` (minutes) comes, and since."""
    settings = IncidentSettings()
    prepare_fusion(settings.fusion)
    incident = Incident(settings, keeps_all=False)
    crews = [min(CREW, responders - first) for first in range(0, responders, CREW)]
    said = list(crowd(crews, 0, minutes + after, 1.0, 2, within_s=40.0))
    comes_ns = said[0].message.event_time_ns + round(minutes * NS_PER_MIN)
    since_ns = comes_ns - round(late * NS_PER_MIN)
    stride = next(
        each for each in said
        if isinstance(each.message, OdometryIncrement) and each.message.event_time_ns >= since_ns
    )  # fmt: skip
    before = [each for each in said if each.message.event_time_ns < comes_ns and each is not stride]
    rest = [each for each in said if each.message.event_time_ns >= comes_ns]
    usual = summed_up(handled(incident, before), minutes)
    return {
        "before": usual,
        "since": summed_up(handled(incident, [stride, *rest], comes_ns), after),
    }


def main() -> int:
    """Run the command line."""
    parser = argparse.ArgumentParser(prog="python -m tests.faults.late_message")
    parser.add_argument("--responders", type=int, default=12)
    parser.add_argument("--minutes", type=float, default=20.0)
    parser.add_argument("--late", type=float, default=19.0, help="minutes")
    parser.add_argument("--after", type=float, default=5.0, help="minutes")
    parser.add_argument("--at-once", action="store_true")
    given = parser.parse_args()
    if given.at_once:
        lines.AT_ONCE_WORK = lines.CROWD_WORK = sys.maxsize
    took = one_is_late(given.responders, given.minutes, given.late, given.after)
    print(json.dumps({name: each._asdict() for name, each in took.items()}), flush=True)  # noqa: T201
    return 0


if __name__ == "__main__":
    sys.exit(main())
