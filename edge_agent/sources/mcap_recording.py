"""A source that reads the inertial samples of one responder out of a recording of the post."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

from shared.codec import Refusal, decode, parse_key
from shared.mcap_reader import RecordingError, read_recording
from shared.messages import WITHOUT_GYRO, ImuBatch, ImuSample, Vector3


def read_imu_samples(path: Path, responder_id: str | None = None) -> Iterator[ImuSample]:
    """Yield what the mount of ``responder_id`` was given, in time order, each sample once.

    ``responder_id`` may be left out where only one responder's samples were recorded. A batch
    that came twice counts once, one that came late takes its place. Times are of the clock of
    the agent that sent them.

    Raises ``RecordingError`` if ``path`` cannot be read, holds no samples of that responder (the
    text says of whom it does), or holds a batch whose lists do not fit one another.
    """
    by_responder = _batches(path)
    chosen = _choose(path, sorted(by_responder), responder_id)
    last_ns = -1
    for _, batch in sorted(by_responder[chosen].items()):
        for sample in _samples(path, batch):
            if sample.time_ns > last_ns:
                last_ns = sample.time_ns
                yield sample


def _batches(path: Path) -> dict[str, dict[tuple[int, int], ImuBatch]]:
    """Return the batches of each responder by time and number, for an agent may start anew at 0."""
    found: dict[str, dict[tuple[int, int], ImuBatch]] = {}
    for message in read_recording(path):
        key = parse_key(message.key)
        if isinstance(key, Refusal):
            continue
        batch = decode(key, message.payload)
        if isinstance(batch, ImuBatch):
            batches = found.setdefault(key.node_id, {})
            batches.setdefault((batch.event_time_ns, batch.sequence), batch)
    return found


def _choose(path: Path, responders: list[str], wanted: str | None) -> str:
    there = ", ".join(responders)
    if not responders:
        raise RecordingError(f"{path}: no inertial samples in it; record with raw samples")
    if wanted is None and len(responders) > 1:
        raise RecordingError(f"{path}: samples of {there}; name one, as in {path}#{responders[0]}")
    if wanted is not None and wanted not in responders:
        raise RecordingError(f"{path}: no samples of {wanted}; there are some of {there}")
    return wanted or responders[0]


def _samples(path: Path, batch: ImuBatch) -> Iterator[ImuSample]:
    expected = 3 * len(batch.time_ns)
    optional = (len(batch.rate_rad_s) or expected, len(batch.field_ut) or expected)
    lengths = [len(batch.force_m_s2), *optional]
    if lengths != [expected] * 3:
        raise RecordingError(
            f"{path}: batch {batch.sequence} has {len(batch.time_ns)} times, but {lengths[0]}, "
            f"{lengths[1]} and {len(batch.field_ut)} numbers of force, rate and field"
        )
    pressures = _pressures(path, batch)
    forces, rates, fields = map(_vectors, (batch.force_m_s2, batch.rate_rad_s, batch.field_ut))
    for index, time_ns in enumerate(batch.time_ns):
        field = fields[index] if fields else None
        rate = rates[index] if rates else WITHOUT_GYRO
        yield ImuSample(time_ns, forces[index], rate, field, pressures.get(index))


def _pressures(path: Path, batch: ImuBatch) -> dict[int, float]:
    rows = batch.pressure_rows
    rising = all(row < after for row, after in pairwise((-1, *rows, len(batch.time_ns))))
    if len(rows) != len(batch.pressure_pa) or not rising:
        raise RecordingError(
            f"{path}: batch {batch.sequence} has {len(batch.pressure_pa)} pressures for "
            f"{len(rows)} rows, which are to rise below {len(batch.time_ns)}"
        )
    return dict(zip(rows, batch.pressure_pa, strict=True))


def _vectors(flat: tuple[float, ...]) -> list[Vector3]:
    return list(zip(flat[0::3], flat[1::3], flat[2::3], strict=True))
