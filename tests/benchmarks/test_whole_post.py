"""A thousand responders and one core: messages in to estimates out, the post as a whole.

The post is its decoder, time line, fusion, encoder and recording, without a network. Messages come
when they would, two strides a second of each responder, late by what a network takes; each waits
while those before it are handled, and how long that takes is the processor time really spent; what
becomes due while nothing is heard is made then. So the figures are those of a core that does
nothing else, whatever else this machine does meanwhile.

``CLEW_POST_MINUTES`` says for how long people walk: a crew's commits grow until minute six.
"""

from __future__ import annotations

import gc
import os
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from time import process_time_ns
from typing import NamedTuple

import numpy as np
import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from command_post.desks.announcer import Outgoing
from command_post.fusion.methods import prepare_fusion
from command_post.fusion.time_line import TimeLineSettings
from command_post.incident import Incident, IncidentSettings
from command_post.recorder.file import RecordingFile
from command_post.recorder.recorded import Outgoing as MadeOutgoing
from command_post.recorder.recording import RecordedIncident
from shared.codec import Refusal, decode, encode, parse_key
from shared.messages import OdometryIncrement, TrackEstimate
from shared.topics import Key
from shared.units import NS_PER_S
from tests.benchmarks.crowd import START_NS, Floats, crowd
from tests.benchmarks.test_team_speed import role_of, topic_of

MINUTES = float(os.environ.get("CLEW_POST_MINUTES", "2"))
STEPS_A_SECOND = 2.0
CREWS = [16] * 57 + [100]
FEW_MINUTES, FEW_CREWS = 1.0, [4, 20]
"""Where nothing is timed: a small crew, and one too large to be solved as one."""

NETWORK_S = (0.005, 0.06)
LATE_SHARE, LATE_S = 0.002, 3.0
FREEZE_EVERY = 512
"""About as often as the post does, which is four times a second."""


class Frame(NamedTuple):
    """A message when it arrives; ``moved`` says whose stride it is, and when that ended."""

    arrives_ns: int
    key: str
    payload: bytes
    moved: tuple[str, int] | None


def frames(sizes: list[int], minutes: float) -> list[Frame]:
    """Return what all say in the order of arrival; a few messages come late."""
    chance = np.random.default_rng(11)

    def arriving() -> Iterator[Frame]:
        for node_id, message in crowd(sizes, 0, minutes + 0.7, STEPS_A_SECOND, 2, within_s=40.0):
            time_ns = message.event_time_ns
            if time_ns > START_NS + minutes * 60 * NS_PER_S:
                return
            on_the_way_s = chance.uniform(*NETWORK_S)
            if chance.random() < LATE_SHARE:
                on_the_way_s += chance.uniform(0.0, LATE_S)
            is_stride = isinstance(message, OdometryIncrement)
            yield Frame(
                time_ns + round(on_the_way_s * NS_PER_S),
                str(Key("exercise", role_of(message), node_id, topic_of(message))),
                encode(message),
                (node_id, time_ns) if is_stride else None,
            )

    return sorted(arriving(), key=lambda each: each.arrives_ns)


class Served(NamedTuple):
    """Each call's processor time, when that was done, and what came of it."""

    took_ns: list[int]
    done_ns: list[int]
    made: list[list[Outgoing]]


def serve(incident: Incident, heard: list[Frame], path: Path) -> Served:
    """Handle all of it one after another, each when it has come and the one before is done."""
    served = Served([], [], [])
    record = RecordingFile(path, {})
    recorded = RecordedIncident(incident, record)
    free_ns = 0
    began_ns = process_time_ns()

    def note(start_ns: int, made: Sequence[MadeOutgoing]) -> None:
        nonlocal free_ns, began_ns
        ended_ns = process_time_ns()
        free_ns = start_ns + ended_ns - began_ns
        served.took_ns.append(ended_ns - began_ns)
        served.done_ns.append(free_ns)
        served.made.append([Outgoing(each.key, each.payload) for each in made])
        began_ns = ended_ns

    for number, (arrives_ns, key, payload, _) in enumerate(heard):
        if number % FREEZE_EVERY == 0:
            gc.freeze()
        while (due_ns := incident.due_ns) is not None and max(due_ns, free_ns) < arrives_ns:
            idle_ns = max(due_ns, free_ns)
            note(idle_ns, recorded.pass_time(idle_ns))
        note(max(arrives_ns, free_ns), recorded.handle(key, payload, arrives_ns))
    record.finish()
    return served


def delays_ms(heard: list[Frame], served: Served, hold_ns: int, since_ns: int) -> Floats:
    """Return how long after a stride could be told it was: (n, 2), and how long after it came.

    It can be told once it is there, and ``hold_ns`` after it ended, for which those before it are
    waited for.
    """
    came = {each.moved: each.arrives_ns for each in heard if each.moved is not None}
    delays = []
    for done_ns, made in zip(served.done_ns, served.made, strict=True):
        for key, payload in made if done_ns >= since_ns else ():
            parsed = parse_key(key)
            assert not isinstance(parsed, Refusal)
            estimate = decode(parsed, payload)
            if not isinstance(estimate, TrackEstimate):
                continue
            arrived_ns = came.pop((estimate.responder_id, estimate.event_time_ns), None)
            if arrived_ns is not None:
                due_ns = max(arrived_ns, estimate.event_time_ns + hold_ns)
                delays.append((done_ns - due_ns, done_ns - arrived_ns))
    return np.array(delays) / 1e6


@pytest.mark.parametrize("hold_s", [None, 1.5])
def test_a_thousand_responders_on_one_core(
    benchmark: BenchmarkFixture, hold_s: float | None, tmp_path: Path
) -> None:
    settings = IncidentSettings(time_line=TimeLineSettings(hold_s=hold_s))
    prepare_fusion(settings.fusion)
    minutes, crews = (MINUTES, CREWS) if benchmark.enabled else (FEW_MINUTES, FEW_CREWS)
    heard = frames(crews, minutes)
    incident = Incident(settings)
    served: list[Served] = []

    def run() -> None:
        served.append(serve(incident, heard, tmp_path / "crowd.mcap"))

    benchmark.pedantic(run, rounds=1, iterations=1)  # type: ignore[no-untyped-call]
    gc.unfreeze()
    # Before, people still set out.
    since_ns = START_NS + round(max(minutes - 2.0, 0.8) * 60) * NS_PER_S
    counted = [each for each in heard if each.arrives_ns >= since_ns]
    strides = sum(each.moved is not None for each in counted)
    calls = zip(served[0].took_ns, served[0].done_ns, strict=True)
    took_s = sum(took_ns for took_ns, done_ns in calls if done_ns >= since_ns) / NS_PER_S
    lasted_s = (heard[-1].arrives_ns - since_ns) / NS_PER_S
    delays = delays_ms(heard, served[0], settings.hold_ns, since_ns)
    assert len(delays) > 0.9 * strides
    p50, p99 = np.percentile(delays, (50.0, 99.0), axis=0)
    benchmark.extra_info.update(
        responders=len(incident.estimates),
        steps_per_s=round(strides / lasted_s),
        steps_per_s_of_a_core=round(strides / took_s),
        share_of_a_core=round(took_s / lasted_s, 2),
        p50_ms=round(p50[0], 2),
        p99_ms=round(p99[0], 1),
        worst_ms=round(delays[:, 0].max()),
        p99_with_hold_ms=round(p99[1], 1),
        late=Counter(incident.counts)["late_fused"],
    )
