"""Does a post that runs for a day still do as it did in its third hour? Without any network.

``python -m tests.faults.long_incident --hours 24 --responders 4`` has the post's incident handle
what so many responders say who walk for so long, a stride a second each, past DAPs that they set
down, as fast as the machine goes. It prints JSON, an object for each simulated hour: what share of
a core that would have taken, what memory the process has, how many MB the state has that is kept
beside the recording, and how long that takes: means of twelve moments. At the end comes by how much
memory and state grew for each hour since everything that is kept for a while has been kept for that
long, by a line through the hours since; and what each part of the state holds. ``--horizon`` and
``--lateness`` (minutes) make that sooner. It is *flat* if the line of the state rises by less than
0.5 % of it in an hour, and that of the memory by less than 1 % of it: the exit code says so too.
"""

from __future__ import annotations

import argparse
import json
import os
import pickle
import sys
import time
from collections.abc import Iterator, Sequence
from statistics import fmean
from typing import NamedTuple

import numpy as np
from msgspec import structs

from command_post.fusion.methods import prepare_fusion
from command_post.fusion.settings import FusionSettings
from command_post.fusion.team.settings import TeamSettings
from command_post.incident import Incident
from command_post.incident_settings import IncidentSettings
from shared.codec import encode
from shared.messages import DapInstallation, Message, OdometryIncrement, RssiPeak, TrackStart
from shared.topics import Key
from shared.units import NS_PER_S
from tests.benchmarks.crowd import Said, crowd
from tests.benchmarks.test_team_speed import role_of, topic_of
from tests.faults.soak import held_by

CREW = 12
HOUR_NS = 3600 * NS_PER_S
SEQUENCES_AN_HOUR = 10_000
MOMENTS = 12
"""In an hour: strides are packed by hundreds, and now there are more unpacked, now fewer."""

ARRIVES_S = (0.005, 0.06)
MOST_STATE_GROWTH, MOST_MEMORY_GROWTH = 0.005, 0.01
"""Of itself in an hour."""

FULL_MARGIN_H = 0.35
"""The horizon is moved on by quarters, commits are thinned out, and buffers have to fill."""


class Hour(NamedTuple):
    """What a simulated hour took, and what was held in it on average."""

    hour: int
    core_share: float
    memory_mb: float
    state_mb: float
    kept_s: float


class Moment(NamedTuple):
    """What is held."""

    memory_mb: float
    state_mb: float
    kept_s: float


def walk(responders: int, hours: int, seed: int) -> Iterator[Said]:
    """Yield what is said, hour by hour: all walk round and round, and begin each hour anew."""
    crews = [min(CREW, responders - first) for first in range(0, responders, CREW)]
    for hour in range(hours):
        for said in crowd(crews, 0, 60.0, 1.0, seed + hour, within_s=40.0):
            if not hour or isinstance(said.message, (OdometryIncrement, RssiPeak)):
                yield Said(said.node_id, _later(said.message, hour))


def _later(message: Message, hour: int) -> Message:
    time_ns = message.event_time_ns + hour * HOUR_NS
    sequence = message.sequence + hour * SEQUENCES_AN_HOUR
    if isinstance(message, OdometryIncrement):
        start_ns = message.start_time_ns + hour * HOUR_NS
        return structs.replace(
            message, event_time_ns=time_ns, sequence=sequence, start_time_ns=start_ns
        )
    assert isinstance(message, (RssiPeak, TrackStart, DapInstallation))
    return structs.replace(message, event_time_ns=time_ns, sequence=sequence)


def lived(incident: Incident, responders: int, hours: int, seed: int) -> Iterator[Hour]:
    """Have the incident handle ``hours`` of what is said; yield each."""
    chance = np.random.default_rng(seed)
    worked_s, next_ns, now_ns = 0.0, 0, 0
    moments: list[Moment] = []
    for node_id, message in walk(responders, hours, seed):
        next_ns = next_ns or message.event_time_ns + HOUR_NS // MOMENTS
        key = str(Key("exercise", role_of(message), node_id, topic_of(message)))
        arrives_ns = message.event_time_ns + round(chance.uniform(*ARRIVES_S) * NS_PER_S)
        now_ns = max(now_ns, arrives_ns)
        payload, began_s = encode(message), time.process_time()
        incident.handle(key, payload, now_ns)
        worked_s += time.process_time() - began_s
        if message.event_time_ns >= next_ns:
            moments.append(_moment(incident))
            next_ns += HOUR_NS // MOMENTS
            if not len(moments) % MOMENTS:
                means = (round(fmean(each), 4) for each in zip(*moments[-MOMENTS:], strict=True))
                yield Hour(len(moments) // MOMENTS, round(worked_s / 3600.0, 4), *means)
                worked_s = 0.0


def _moment(incident: Incident) -> Moment:
    memory_mb = held.memory_mb if (held := held_by(os.getpid())) is not None else 0.0
    began_s = time.process_time()
    state_mb = len(pickle.dumps(incident, protocol=5)) / 1e6
    return Moment(memory_mb, state_mb, time.process_time() - began_s)


def growth(hours: Sequence[Hour], settings: TeamSettings) -> dict[str, object]:
    """Return by how much memory and state grew in an hour since all was full, and if that is flat.

    It is ``None`` where there are fewer than three such hours.
    """
    full_h = (1.25 * settings.horizon_s + settings.lateness_s) / 3600.0 + FULL_MARGIN_H
    since = [each for each in hours if each.hour >= full_h]
    if len(since) < 3:
        return {"full_after_h": full_h, "flat": None}
    number = np.array([each.hour for each in since])
    state_mb, memory_mb = (
        np.array([getattr(each, name) for each in since]) for name in ("state_mb", "memory_mb")
    )
    state_mb_h, memory_mb_h = (
        float(np.polyfit(number, held, 1)[0]) for held in (state_mb, memory_mb)
    )
    return {
        "full_after_h": full_h,
        "hours": len(since),
        "state_mb_an_hour": state_mb_h,
        "memory_mb_an_hour": memory_mb_h,
        "flat": state_mb_h < MOST_STATE_GROWTH * float(state_mb.mean())
        and memory_mb_h < MOST_MEMORY_GROWTH * float(memory_mb.mean()),
    }


def parts_kb(whole: object) -> dict[str, float]:
    """Return what each attribute of an object holds by itself, pickled, the largest first."""
    sizes = {
        name.strip("_"): len(pickle.dumps(part, protocol=5)) / 1e3
        for name, part in vars(whole).items()
    }
    return dict(sorted(sizes.items(), key=lambda each: -each[1])[:12])


def main() -> int:
    """Run the command line."""
    usual = TeamSettings()
    parser = argparse.ArgumentParser(prog="python -m tests.faults.long_incident")
    parser.add_argument("--hours", type=int, default=24)
    parser.add_argument("--responders", type=int, default=4)
    parser.add_argument("--horizon", type=float, default=usual.horizon_s / 60.0, help="minutes")
    parser.add_argument("--lateness", type=float, default=usual.lateness_s / 60.0, help="minutes")
    parser.add_argument("--keep-all", action="store_true", help="forget nothing, as afterwards")
    given = parser.parse_args()
    team = TeamSettings(horizon_s=60.0 * given.horizon, lateness_s=60.0 * given.lateness)
    settings = IncidentSettings(fusion=FusionSettings(team=team))
    prepare_fusion(settings.fusion)
    incident = Incident(settings, keeps_all=given.keep_all)
    hours = []
    for hour in lived(incident, given.responders, given.hours, seed=1):
        hours.append(hour)
        _tell(hour._asdict())
    _tell({"incident_kb": parts_kb(incident), "fusion_kb": parts_kb(incident._tracker)})
    found = growth(hours, team)
    _tell(found)
    return 0 if found["flat"] else 1


def _tell(what: dict[str, object]) -> None:
    print(json.dumps(what), flush=True)  # noqa: T201


if __name__ == "__main__":
    sys.exit(main())
