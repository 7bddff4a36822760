"""What it takes to read the gist of a long recording, with and without the one that was kept.

``python -m tests.faults.gist_cost --hours 6 --responders 12`` records what so many responders say
in so many hours (a stride and two beats a second each, and what the post tells of each stride), in
parts of an hour as a post does, and leaves it unfinished. It prints as JSON the seconds of a core
for reading all of it, and for the gist kept and what was recorded since.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from msgspec import structs

from command_post.recorder.parts import Rotation
from command_post.recorder.recording import Recorder
from command_post.resuming.gist import Gist
from command_post.resuming.gist_keeper import GistKeeper, gist_of, gist_path
from shared.codec import decode, encode, parse_key
from shared.mcap_reader import RecordedMessage, read_recording
from shared.messages import Beat, OdometryIncrement, TrackEstimate
from shared.seal import sealed
from shared.topics import Key
from shared.units import NS_PER_S
from tests.unit.test_post import START_NS, key, start, stride
from tests.waiting import wait_for

RUN = b"\x01" * 8
PATIENCE_S = 1200.0
HOUR_NS = 3600 * NS_PER_S
SAID_WITHOUT_SYNC = 20_000


def said(responders: int, seconds: int) -> Iterator[RecordedMessage]:
    """Yield what everybody says in so long, and what is told of it."""
    move = decode(_key("increment"), stride(0))
    assert isinstance(move, OdometryIncrement)
    told = TrackEstimate(
        event_time_ns=0, sequence=0, responder_id="r0", north_m=0.0, east_m=0.0, down_m=0.0,
        covariance_m2=(0.1, 0.0, 0.1), heading_rad=0.0, heading_sd_rad=0.1,
        last_proximity_time_ns=None, down_sd_m=0.1,
    )  # fmt: skip
    names = [f"r{number}" for number in range(responders)]
    for name in names:
        yield RecordedMessage(START_NS, 0, key("start", node=name), sealed(start(), RUN, 1), False)
    for second in range(1, seconds):
        now_ns = START_NS + second * NS_PER_S
        for number, name in enumerate(names):
            step = structs.replace(
                move, sequence=second, event_time_ns=now_ns, start_time_ns=now_ns - NS_PER_S
            )
            beat = Beat(
                event_time_ns=now_ns, sequence=second, run=RUN.hex(), last_number=second + 1,
                kept_from=1, acknowledged=second,
            )  # fmt: skip
            walked = structs.replace(
                told, sequence=second * responders + number, event_time_ns=now_ns,
                responder_id=name, north_m=float(second),
            )  # fmt: skip
            for topic, payload in (
                ("increment", sealed(encode(step), RUN, second + 1)),
                ("beat", sealed(encode(beat), RUN, 2 * second)),
                ("beat", sealed(encode(beat), RUN, 2 * second + 1)),
            ):
                yield RecordedMessage(now_ns, 0, key(topic, node=name), payload, False)
            yield RecordedMessage(now_ns, 0, key("track", "post", "p"), encode(walked), True)


def _key(topic: str) -> Key:
    parsed = parse_key(key(topic))
    assert isinstance(parsed, Key)
    return parsed


def record(path: Path, responders: int, hours: float) -> int:
    """Record it at ``path``, unfinished, with its gist; return how many messages."""
    count = 0
    with (
        suppress(InterruptedError),
        Recorder(path, {}, rotation=Rotation(256 << 20, HOUR_NS)) as recorder,
    ):
        GistKeeper(gist_path(path), Gist(), recorder)
        for each in said(responders, round(hours * 3600)):
            recorder.put(each.key, each.payload, each.log_time_ns, outgoing=each.outgoing)
            count += 1
            if count % SAID_WITHOUT_SYNC == 0:
                wait_for(lambda: recorder.has_room, "the disk", PATIENCE_S)
        wait_for(lambda: recorder.safe == recorder.taken, "the disk", PATIENCE_S)
        raise InterruptedError
    return count


def main() -> int:
    """Run the command line."""
    parser = argparse.ArgumentParser(prog="python -m tests.faults.gist_cost", description=__doc__)
    parser.add_argument("--hours", type=float, default=6.0)
    parser.add_argument("--responders", type=int, default=12)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="clew-gist-") as folder:
        path = Path(folder) / "a.mcap"
        messages = record(path, given.responders, given.hours)
        costs_s, moves = {}, set[int]()
        for name, where in (("kept", gist_path(path)), ("all", path.with_name("none"))):
            recording = read_recording(path)
            began_s = time.process_time()
            moves.add(gist_of(where, recording).moves)
            costs_s[name] = round(time.process_time() - began_s, 2)
            costs_s[f"{name}_messages"] = recording.report.message_count
        kept_mb = round(gist_path(path).stat().st_size / 1e6, 2)
    assert len(moves) == 1
    told = {"messages": messages, "moves": moves.pop(), "gist_mb": kept_mb, **costs_s}
    print(json.dumps(told))  # noqa: T201
    return 0


if __name__ == "__main__":
    sys.exit(main())
