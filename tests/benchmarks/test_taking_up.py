"""How long a post takes to take an incident up again after a kill, from its recording.

Twelve responders walk, a stride a second each, for ``CLEW_TAKE_UP_MINUTES``; the state is kept as
at a post, and the kill comes at the worst moment, just before it would have been kept again.
"""

from __future__ import annotations

import os
import time
from pathlib import Path

import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from command_post.fusion.methods import prepare_fusion
from command_post.incident import Incident, IncidentSettings
from command_post.recorder.recording import RecordedIncident, Recorder
from command_post.resuming.beside import BEGINNING
from command_post.resuming.checkpoint import Checkpoints, State, checkpoint_path, kept_states
from command_post.resuming.resume import Resumed, resume
from shared.gate import Gate
from shared.mcap_reader import read_recording
from tests.benchmarks import test_whole_post
from tests.benchmarks.test_whole_post import frames
from tests.waiting import wait_for

MINUTES = float(os.environ.get("CLEW_TAKE_UP_MINUTES", "10"))
FEW_MINUTES = 0.8
RESPONDERS = 12


def test_an_incident_is_taken_up(
    benchmark: BenchmarkFixture, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(test_whole_post, "STEPS_A_SECOND", 1.0)
    settings, gate = IncidentSettings(), Gate()
    prepare_fusion(settings.fusion)
    path = tmp_path / "a.mcap"
    incident, stalls_s = Incident(settings), [0.0]
    with Recorder(path, settings.as_metadata()) as recorder:
        recorded = RecordedIncident(incident, recorder)
        checkpoints = Checkpoints(checkpoint_path(path), recorder)
        for arrives_ns, key, payload, _ in frames(
            [RESPONDERS], MINUTES if benchmark.enabled else FEW_MINUTES
        ):
            if checkpoints.is_due:
                began_s = time.perf_counter()
                checkpoints.keep(State(incident, gate.remembered(), None, 0))
                stalls_s.append(time.perf_counter() - began_s)
            began_s = time.perf_counter()
            recorded.handle(key, payload, arrives_ns)
            checkpoints.work(time.perf_counter() - began_s)
        wait_for(lambda: recorder.safe == recorder.taken, "the disk")

        def take_up() -> tuple[Incident, Resumed]:
            kept = next(kept_states(checkpoint_path(path), recorder.part, settings), None)
            of_kept = Incident(settings) if kept is None else kept.state.incident
            place = BEGINNING if kept is None else kept.place
            since = read_recording(recorder.part).since(*place)
            return of_kept, resume(since, of_kept, gate.recall)

        again, resumed = benchmark.pedantic(take_up, rounds=1, iterations=1)  # type: ignore[no-untyped-call]
    assert resumed.differing == 0
    assert again.estimates == incident.estimates
    benchmark.extra_info["longest stall (ms)"] = round(1e3 * max(stalls_s), 1)
    benchmark.extra_info["handled again"] = resumed.handled
