"""A post that is killed comes back with its recording gone on with, and nothing said is missing."""

from __future__ import annotations

import signal
import subprocess
import sys
import threading
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from command_post.incident import Incident
from command_post.replay import recorded_settings, replay
from shared.bus.zenoh_bus import ZenohBus
from shared.codec import decode, parse_key
from shared.mcap_reader import read_recording
from shared.messages import TrackEstimate
from shared.outbox import JournalledOutbox
from shared.process import ExitCode
from shared.topics import Key
from tests.bus.test_zenoh import free_endpoint
from tests.faults.fleet import acknowledged, is_safe
from tests.faults.hearing import strides_in
from tests.faults.talker import Talker
from tests.waiting import wait_for

STARTED_S = 60.0
"""A post may take that long to start on a busy machine."""

STRIDES_PER_S = 4.0


@pytest.fixture(autouse=True)
def _patient(monkeypatch: pytest.MonkeyPatch) -> None:
    """A busy machine's disk may take long: that is another test's matter."""
    monkeypatch.setattr("shared.outbox.PATIENCE_S", 60.0)


class Site:
    """A post that can be killed, and units that talk to it whether it is there or not."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.endpoint = free_endpoint()
        self.recording = folder / "a.mcap"
        self.part = folder / "a.mcap.part"
        self.journals: list[Path] = []
        self._post: subprocess.Popen[bytes] | None = None

    def start(self, *options: str) -> subprocess.Popen[bytes]:
        """Start the post, always by the same command but for ``options``."""
        command = ("run", "--insecure", "--incident", "fire", "--listen", self.endpoint)
        with (self.folder / "said").open("ab") as said:
            self._post = subprocess.Popen(
                [
                    sys.executable, "-m", "command_post", *command,
                    "--record", str(self.recording), *options,
                ],
                stdout=said, stderr=said,
            )  # fmt: skip
        return self._post

    def kill(self) -> None:
        """Kill the post as nothing can be caught."""
        assert self._post is not None
        self._post.kill()
        self._post.wait()

    def stop(self) -> int:
        """Have the post end by itself; return what its exit says."""
        assert self._post is not None
        self._post.send_signal(signal.SIGTERM)
        return self._post.wait(STARTED_S)

    def has_opened_the_recording(self) -> bool:
        """Say whether the post is at the recording, if only to take it up."""
        assert self._post is not None
        try:
            held = [each.readlink() for each in Path(f"/proc/{self._post.pid}/fd").iterdir()]
        except OSError:
            return False
        return self.part in held

    def said(self) -> str:
        """Return all that the posts have said so far."""
        return (self.folder / "said").read_text()

    def recorded(self) -> Counter[bytes]:
        """Return how often each stride stands in the recording."""
        path = self.recording if self.recording.exists() else self.part
        if not path.exists() or path.stat().st_size < 1000:
            return Counter()
        return Counter(
            each.payload for each in read_recording(path) if each.key.endswith("/increment")
        )

    def records(self, more: int) -> None:
        """Wait until so many more strides are in the recording."""
        before = self._acknowledged()
        wait_for(lambda: self._acknowledged() >= before + more, "strides recorded", STARTED_S)

    def _acknowledged(self) -> int:
        """Return how many strides the post has said are on its disk."""
        return sum(map(acknowledged, self.journals))

    @contextmanager
    def talking(self, *node_ids: str) -> Iterator[None]:
        """Have units talk, and at the end wait until all that they have said is recorded."""
        stop = threading.Event()
        talkers = [threading.Thread(target=self._talk, args=(each, stop)) for each in node_ids]
        for thread in talkers:
            thread.start()
        try:
            yield
        finally:
            stop.set()
            for thread in talkers:
                thread.join()

    def _talk(self, node_id: str, stop: threading.Event) -> None:
        path = self.folder / node_id
        self.journals.append(path)
        with (
            JournalledOutbox(path) as outbox,
            ZenohBus("client", [self.endpoint], []) as bus,
        ):
            talker = Talker(bus, "fire", node_id, outbox)
            with talker.heartbeat:
                talker.talk(STRIDES_PER_S, stop)
                # Who has said all goes on to answer for it.
                wait_for(lambda: is_safe(path), f"all of {node_id}", STARTED_S)

    def assert_whole(self, times_killed: int) -> None:
        """Check that all is recorded once, and that a replay makes the same of it."""
        kept = self.recorded()
        assert set(kept) == set().union(*(strides_in(path) for path in self.journals))
        assert set(kept.values()) == {1}
        report = replay(self.recording, Incident(recorded_settings(self.recording)))
        assert report.identical, report
        assert report.reading.complete
        assert report.reading.resumed_count == times_killed


@pytest.fixture
def site(tmp_path: Path) -> Iterator[Site]:
    site = Site(tmp_path)
    yield site
    if site._post is not None:
        site.kill()


def estimates_in(recording: Path) -> Iterator[TrackEstimate]:
    for each in read_recording(recording):
        key = parse_key(each.key)
        if isinstance(key, Key) and key.topic == "track":
            estimate = decode(key, each.payload)
            assert isinstance(estimate, TrackEstimate)
            yield estimate


def test_killed_again_and_again_it_goes_on_with_everything(site: Site) -> None:
    with site.talking("r1", "r2"):
        site.start()
        site.records(15)
        site.kill()
        site.start()
        site.records(25)
        site.kill()
        # Once more, and again while it takes the incident up.
        site.start()
        wait_for(site.has_opened_the_recording, "the recording to be taken up", STARTED_S)
        site.kill()
        site.start()
        site.records(25)
    assert site.stop() == ExitCode.OK
    assert not (site.folder / "a.mcap.checkpoint").exists()
    site.assert_whole(times_killed=2 + site.said().count("taken up again") - 2)
    sequences = [estimate.sequence for estimate in estimates_in(site.recording)]
    assert sequences == list(range(len(sequences)))
    assert len(sequences) > 50


def test_killed_before_it_heard_anything_it_begins_as_usual(site: Site) -> None:
    site.start()
    wait_for(site.has_opened_the_recording, "the recording to begin", STARTED_S)
    site.kill()
    with site.talking("r1"):
        site.start()
        site.records(20)
    assert site.stop() == ExitCode.OK
    assert set(site.recorded().values()) == {1}


def test_what_another_incident_left_is_refused_in_clear_words(site: Site) -> None:
    with site.talking("r1"):
        site.start()
        site.records(5)
    site.kill()
    before = site.part.read_bytes()
    assert site.start("--seed", "7").wait(STARTED_S) == ExitCode.USAGE
    assert "was begun with other settings: fusion.seed 1, not 7" in site.said()
    assert site.part.read_bytes() == before


def test_two_posts_at_one_recording_do_not_spoil_it(site: Site) -> None:
    with site.talking("r1"):
        site.start()
        site.records(5)
        first, site.endpoint = site._post, free_endpoint()
        assert site.start().wait(STARTED_S) == ExitCode.USAGE
        assert "another process has it" in site.said()
        site._post = first
        site.records(5)
    assert site.stop() == ExitCode.OK
    site.assert_whole(times_killed=0)
