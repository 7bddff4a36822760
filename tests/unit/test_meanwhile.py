"""While an incident is taken up from its recording alone, people are shown where they were."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import count
from pathlib import Path

import pytest

from command_post.incident import Incident
from command_post.recorder.file import RecordingFile
from command_post.recorder.recording import RecordedIncident
from command_post.resuming.gist import Gist
from command_post.resuming.meanwhile import AGAIN_S, telling
from command_post.resuming.resume import Made
from shared.mcap_reader import Recording, read_recording
from shared.messages import TrackEstimate
from tests.heard import message_in
from tests.unit.test_post import NOW_NS, SETTINGS, key, start, stride


@pytest.fixture
def recording(tmp_path: Path) -> Recording:
    """Two responders' strides, and what was told of them, of a post that was killed."""
    file = RecordingFile(tmp_path / "a.mcap", {})
    incident = RecordedIncident(Incident(SETTINGS), file)
    for name in ("r1", "r2"):
        incident.handle(key("start", node=name), start(), NOW_NS)
        for number in range(3):
            incident.handle(key("increment", node=name), stride(number), NOW_NS)
    file.sync()
    file.abandon()
    return read_recording(file.part)


def told_last(recording: Recording) -> list[Made]:
    gist = Gist()
    gist.read(recording)
    return [Made(each.log_time_ns, each.key, each.payload) for each in gist.told]


def test_what_was_told_last_of_each_is_found(recording: Recording) -> None:
    told = told_last(recording)
    recorded = [each for each in recording if each.outgoing]
    newest = {}
    for each in recorded:
        estimate = message_in(each)  # type: ignore[arg-type]
        assert isinstance(estimate, TrackEstimate)
        newest[estimate.responder_id] = each.payload
    assert sorted(newest) == ["r1", "r2"]
    assert [each.payload for each in told] == list(newest.values())


def test_it_is_told_again_and_again_until_all_is_handled(recording: Recording) -> None:
    told = told_last(recording)
    said = list[Sequence[Made]]()
    # It is looked at the clock at the beginning, for each, and once more where it is told.
    times_s = (0.5 * AGAIN_S * number for number in count())
    handled = list(telling(recording, told, said.append, lambda: next(times_s)))
    assert handled == list(recording)
    assert said == [told] * len(said)
    assert 2 < len(said) <= len(handled)


def test_nothing_is_told_where_nothing_was(recording: Recording) -> None:
    assert len(list(telling(recording, [], lambda _: pytest.fail("told")))) == len(list(recording))
