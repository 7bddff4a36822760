"""The recordings that come with the project: whole, as the manifest says, and replayable."""

from __future__ import annotations

import hashlib
from pathlib import Path

import msgspec
import pytest

from command_post.commands.scoring import read_evidence
from command_post.evaluation.errors import measure
from command_post.evaluation.evidence import Evidence
from command_post.evaluation.score_card import Radii, score
from command_post.incident import Incident, IncidentSettings
from command_post.replay import replay
from edge_agent.agent import Agent
from edge_agent.mounts.methods import default_method, make_mount
from edge_agent.sources.opening import open_source
from shared.bus.interface import Received
from shared.bus.memory import MemoryNetwork
from shared.codec import Refusal, decode, parse_key
from shared.mcap_reader import read_recording
from shared.messages import OdometryIncrement
from shared.sender import Sender
from tests.replay.renew_recordings import ABOUT, MANIFEST, RECORDINGS, Entry

TOLERANCE_M = 0.1
"""Other processors round otherwise, and a particle drawn otherwise moves the mean a little."""

ENTRIES = msgspec.json.decode(MANIFEST.read_bytes(), type=list[Entry])
each = pytest.mark.parametrize("entry", ENTRIES, ids=lambda entry: entry.file)


def test_the_manifest_lists_every_recording() -> None:
    assert [entry.file for entry in ENTRIES] == [about["file"] for about in ABOUT]
    assert {path.name for path in RECORDINGS.glob("*.mcap")} == {entry.file for entry in ENTRIES}


@each
def test_a_recording_is_what_the_manifest_says(entry: Entry) -> None:
    content = (RECORDINGS / entry.file).read_bytes()
    assert len(content) == entry.size_bytes
    assert hashlib.sha256(content).hexdigest() == entry.sha256
    recording = read_recording(RECORDINGS / entry.file)
    assert sum(1 for _ in recording) == entry.messages
    assert recording.report.complete


@each
def test_a_replay_makes_the_same_tracks(entry: Entry) -> None:
    path = RECORDINGS / entry.file
    settings = IncidentSettings.from_metadata(read_recording(path).metadata)
    report = replay(path, Incident(settings))
    assert report.missing == report.extra == 0
    told = replayed_evidence(path, settings)
    close(score(measure(told)).live.absolute, entry.score.live.absolute)
    close(score(measure(told)).live.pair, entry.score.live.pair)


@each
def test_a_recording_scores_as_the_manifest_says(entry: Entry) -> None:
    told = score(measure(read_evidence(RECORDINGS / entry.file)))
    close(told.pdr.absolute, entry.score.pdr.absolute)
    close(told.live.absolute, entry.score.live.absolute)


def test_the_raw_samples_of_a_recording_give_its_strides_again() -> None:
    path = RECORDINGS / "corridor.mcap"
    heard: list[Received] = []
    network = MemoryNetwork()
    network.connect().subscribe("clew/**", heard.append)
    source = open_source(f"mcap:{path}#r1", "r1", 0)
    sender = Sender(network.connect(), "again", "responder", "r1")
    agent = Agent(sender, make_mount("boot"), default_method("boot"), None, sends_imu=False)
    for reading in source.beginning_at(source.begin_ns):
        agent.take(reading)
    agent.finish()
    recorded = [
        decoded(message.key, message.payload)
        for message in read_recording(path)
        if message.key.endswith("/r1/increment")
    ]
    made = [decoded(r.key, r.payload) for r in heard if r.key.endswith("/r1/increment")]
    assert len(made) == len(recorded) > 5
    for one, other in zip(made, recorded, strict=True):
        assert one.event_time_ns == other.event_time_ns
        assert one.d_north_m == pytest.approx(other.d_north_m, abs=1e-9)
        assert one.d_east_m == pytest.approx(other.d_east_m, abs=1e-9)


def decoded(key_text: str, payload: bytes) -> OdometryIncrement:
    key = parse_key(key_text)
    assert not isinstance(key, Refusal)
    message = decode(key, payload)
    assert isinstance(message, OdometryIncrement)
    return message


def replayed_evidence(path: Path, settings: IncidentSettings) -> Evidence:
    """Return what is heard in a recording, with what is made of it now."""
    incident, evidence = Incident(settings), Evidence()
    pairs = [
        pair
        for recorded in read_recording(path)
        if not recorded.outgoing
        for pair in (
            (recorded.key, recorded.payload),
            *incident.handle(recorded.key, recorded.payload, recorded.log_time_ns),
        )
    ]
    for key_text, payload in (*pairs, *incident.finish(0)):
        evidence.add_wire(key_text, payload)
    return evidence


def close(one: Radii | None, other: Radii | None) -> None:
    """Check that two circular errors are the same within ``TOLERANCE_M``."""
    assert one is not None
    assert other is not None
    assert one.ce50_m == pytest.approx(other.ce50_m, abs=TOLERANCE_M)
    assert one.ce95_m == pytest.approx(other.ce95_m, abs=TOLERANCE_M)
