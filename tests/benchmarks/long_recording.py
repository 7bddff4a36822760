"""An hour of a crowd on record: how big it is, and what it costs to read something rare of it.

``python -m tests.benchmarks.long_recording --responders 50 --minutes 60`` records what 50 say: the
ways of a recording of ours, begun at different times and said in other names, a beat a second of
everybody, an alert of somebody now and then. It prints as JSON what that takes, with what is there
to be looked at in Foxglove and without.
"""

from __future__ import annotations

import argparse
import heapq
import io
import itertools
import json
import os
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from mcap.reader import make_reader
from msgspec import structs

from command_post.incident_settings import IncidentSettings
from command_post.recorder.mirror import Mirror
from command_post.recorder.parts import RecordingSet, Rotation
from shared.codec import decode, encode, parse_key
from shared.exercise import REHEARSAL_INCIDENT
from shared.geodesy import Origin
from shared.mcap_reader import read_recording
from shared.messages import Alert, Beat, Message
from shared.topics import Key
from shared.units import NS_PER_S
from tests.benchmarks.test_dap_footprint import resident_mb
from tests.conftest import CHECKOUT

PATTERN = CHECKOUT / "recordings" / "four_daps.mcap"
ALERT_EVERY_S = 60
BEGIN_NS = 1_800_000_000 * NS_PER_S
ALERTS = Key("rehearsal", "post", "post", "alert")
ORIGIN = Origin(latitude_deg=37.5665, longitude_deg=126.978, height_m=38.0, bearing_deg=12.5)


class Said(NamedTuple):
    """Something that is received, or made (``outgoing``), so long after the beginning."""

    after_ns: int
    key: Key
    message: Message
    outgoing: bool


def crowd_says(responders: int, minutes: float) -> Iterator[Said]:
    """Yield in the order of time what so many say, and what is made of it."""
    pattern = list(_pattern())
    names = sorted({each.key.node_id for each in pattern if each.key.role == "responder"})
    long_ns = pattern[-1].after_ns
    crews = -(-responders // len(names))
    until_ns = round(minutes * 60 * NS_PER_S)
    walks = [
        _walk(pattern, crew, crew * long_ns // crews, names[: responders - crew * len(names)])
        for crew in range(crews)
    ]
    people = [f"{name}-{crew}" for crew in range(crews) for name in names][:responders]
    everything = heapq.merge(
        *walks, _beats(people), _alerts(people), key=lambda each: each.after_ns
    )
    return itertools.takewhile(lambda each: each.after_ns < until_ns, everything)


def _pattern() -> Iterator[Said]:
    begin_ns = None
    for log_time_ns, _, key_text, payload, outgoing in read_recording(PATTERN):
        key = parse_key(key_text)
        message = decode(key, payload) if isinstance(key, Key) else None
        begin_ns = log_time_ns if begin_ns is None else begin_ns
        if isinstance(key, Key) and isinstance(message, Message) and key.topic != "truth":
            yield Said(log_time_ns - begin_ns, key, message, outgoing)


def _walk(pattern: list[Said], crew: int, ahead_ns: int, names: list[str]) -> Iterator[Said]:
    """Yield the pattern again and again, of a crew who are ``ahead_ns`` in it."""
    long_ns = pattern[-1].after_ns + NS_PER_S
    for again in itertools.count():
        for after_ns, key, message, outgoing in pattern:
            at_ns = after_ns + again * long_ns - ahead_ns
            who = getattr(message, "responder_id", key.node_id)
            if at_ns >= 0 and (who in names or key.role == "dap"):
                yield Said(at_ns, _of(key, crew), _said_by(message, crew, at_ns), outgoing)


def _of(key: Key, crew: int) -> Key:
    return key if key.role == "post" else key._replace(node_id=f"{key.node_id}-{crew}")


def _said_by(message: Message, crew: int, at_ns: int) -> Message:
    named = {
        name: f"{getattr(message, name)}-{crew}"
        for name in ("responder_id", "dap_id", "installer_id")
        if getattr(message, name, None)
    }
    changed: Message = structs.replace(message, event_time_ns=BEGIN_NS + at_ns, **named)
    return changed


def _beats(people: list[str]) -> Iterator[Said]:
    for number in itertools.count():
        for index, name in enumerate(people):
            at_ns = number * NS_PER_S + index * NS_PER_S // len(people)
            beat = Beat(
                event_time_ns=BEGIN_NS + at_ns, sequence=number, run="0" * 16, last_number=number,
                kept_from=1, acknowledged=number,
            )  # fmt: skip
            yield Said(at_ns, Key("rehearsal", "responder", name, "beat"), beat, outgoing=False)


def _alerts(people: list[str]) -> Iterator[Said]:
    for number in itertools.count(1):
        at_ns = number * ALERT_EVERY_S * NS_PER_S
        alert = Alert(
            event_time_ns=BEGIN_NS + at_ns, sequence=number, number=number, kind="lost_contact",
            role="responder", node_id=people[number % len(people)], since_ns=BEGIN_NS + at_ns,
            stage="raised", words="not heard for 10 s", by=None, assigned_to=None,
        )  # fmt: skip
        yield Said(at_ns, ALERTS, alert, outgoing=True)


class Took(NamedTuple):
    """How long the ending took, and by how much the process has grown since the first minute."""

    ending_s: float
    grown_mb: float


def record(
    path: Path, responders: int, minutes: float, mirror: Mirror | None,
    part_minutes: float | None = None,
) -> Took:  # fmt: skip
    """Record it, synced every second as a post does, in one file or in parts."""
    part_ns = None if part_minutes is None else round(part_minutes * 60 * NS_PER_S)
    rotation = None if part_ns is None else Rotation(1 << 40, part_ns)
    settings = IncidentSettings(incident=REHEARSAL_INCIDENT)
    file = RecordingSet(path, settings.as_metadata(), mirror=mirror, rotation=rotation)
    synced_ns = 0
    before_mb = None
    for after_ns, key, message, outgoing in crowd_says(responders, minutes):
        if after_ns - synced_ns >= NS_PER_S:
            file.sync()
            file.rotate_if_due()
            synced_ns = after_ns
            if before_mb is None and after_ns >= 60 * NS_PER_S:
                before_mb = resident_mb(os.getpid())
        file.put(str(key), encode(message), BEGIN_NS + after_ns, outgoing=outgoing)
    grown_mb = 0.0 if before_mb is None else resident_mb(os.getpid()) - before_mb
    began_s = time.monotonic()
    file.finish()
    return Took(time.monotonic() - began_s, grown_mb)


class CountedFile(io.BufferedReader):
    """A file that counts the bytes that are read of it."""

    counted = 0

    def read(self, size: int | None = -1, /) -> bytes:
        """Read, and count."""
        data = super().read(size)
        self.counted += len(data)
        return data


class Rare(NamedTuple):
    """What it took to read all alerts: how many, of how many bytes, and the index's share."""

    alerts: int
    read_bytes: int
    index_bytes: int


def read_alerts(path: Path) -> Rare:
    """Read the alerts of a recording by its index, with the MCAP library's own reader."""
    with CountedFile(io.FileIO(path)) as stream:
        reader = make_reader(stream)
        reader.get_summary()
        index_bytes = stream.counted
        alerts = sum(1 for _ in reader.iter_messages(topics=[str(ALERTS)]))
        return Rare(alerts, stream.counted, index_bytes)


def main(words: list[str]) -> int:
    """Record it twice; print what that takes."""
    options = argparse.ArgumentParser(prog="python -m tests.benchmarks.long_recording")
    options.add_argument("--responders", type=int, default=50)
    options.add_argument("--minutes", type=float, default=60.0)
    options.add_argument("--part-minutes", type=float, default=10.0)
    given = options.parse_args(words)
    hours = given.responders * given.minutes / 60.0
    with tempfile.TemporaryDirectory(prefix="clew-long-") as folder:
        plain, drawn = Path(folder) / "plain.mcap", Path(folder) / "drawn.mcap"
        parts = Path(folder) / "parts.mcap"
        took_parts = record(parts, given.responders, given.minutes, None, given.part_minutes)
        took = record(plain, given.responders, given.minutes, None)
        record(drawn, given.responders, given.minutes, Mirror(ORIGIN))
        sizes = [path.stat().st_size for path in (plain, drawn)]
        report = read_recording(drawn)
        messages = sum(1 for _ in report)
        told = {
            "messages": messages,
            "drawn": report.report.derived_count,
            "MB": round(sizes[0] / 1e6, 1),
            "MB with what is drawn": round(sizes[1] / 1e6, 1),
            "MB drawn for an hour of a responder": round((sizes[1] - sizes[0]) / 1e6 / hours, 3),
            "MB else for an hour of a responder": round(sizes[0] / 1e6 / hours, 3),
            "ending, s": round(took.ending_s, 2),
            "MB that the process grew by": round(took.grown_mb, 1),
            "MB that it grew by with parts": round(took_parts.grown_mb, 1),
            "to read its alerts": read_alerts(drawn)._asdict(),
        }
    print(json.dumps(told, indent=1))  # noqa: T201
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
