"""Sources by their name on the command line: ``KIND:WHERE``.

A kind's module is imported when one is opened: an agent that reads a sensor has no use for what
simulating or scoring takes, and would wait for it at every start.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterable
from itertools import chain
from pathlib import Path

from edge_agent.gnss import SpeedReading
from edge_agent.mounts.methods import WITHOUT_GYRO, MountName
from edge_agent.sources.reading import Reading, Source
from edge_agent.sources.recording import SourceError
from shared.clock import SystemClock
from shared.mcap_reader import RecordingError
from shared.messages import ImuSample, NodeId
from shared.security.bundle import Bundle

FILES = ("csv", "npz", "phone", "mcap")
KINDS = (*FILES, "phone-live", "simulated")


def open_source(
    name: str,
    responder_id: NodeId,
    seed: int,
    mount: MountName = "boot",
    bundle: Bundle | None = None,
    *,
    hears_daps: bool = False,
) -> Source:
    """Open a source by its name, of a sensor worn as ``mount``.

    It is ``csv:FILE``, ``npz:FILE``, ``phone:EXPORT``, ``phone-live:HOST:PORT``,
    ``mcap:FILE[#responder]`` or ``simulated:SCENARIO``. A live phone is spoken to by ``bundle``. A
    simulated source has the samples of ``responder_id``, whose sensor is worn as ``mount``, in the
    exercise of ``seed``, whom they hear (DAPs if ``hears_daps``), satellite fixes if there are
    any, and the truth. Raises
    ``SourceError`` if there is no such kind or the file cannot be used, and
    ``shared.config.ConfigError`` for a scenario that cannot be used.
    """
    kind, where = check_source(name)
    if kind == "simulated":
        from edge_agent.sources.simulated import open_simulated  # noqa: PLC0415

        return open_simulated(where, responder_id, seed, mount, hears_daps=hears_daps)
    if kind == "phone-live":
        from edge_agent.sources.phone_server import open_phone  # noqa: PLC0415

        return open_phone(where, SystemClock().now_ns, bundle)
    return _open_file(kind, where, mount)


def check_source(name: str) -> tuple[str, str]:
    """Return a source's kind and where it is, before it is opened.

    Raises ``SourceError`` if there is no such kind, or no such file.
    """
    kind, _, where = name.partition(":")
    if not where or kind not in KINDS:
        raise SourceError(
            f"source {name!r}: use csv:FILE, npz:FILE, phone:EXPORT, phone-live:HOST:PORT, "
            "mcap:FILE[#responder] or simulated:SCENARIO"
        )
    file = Path(where.partition("#")[0] if kind == "mcap" else where)
    if kind in FILES and not file.exists():
        raise SourceError(f"source {name!r}: {file} is not there; give the path of a recording")
    return kind, where


def _open_file(kind: str, where: str, mount: MountName) -> Source:
    try:
        samples = iter(_samples(kind, where, mount))
        first = next(samples, None)
        speeds = _speeds(kind, where, mount)
    except RecordingError as error:
        raise SourceError(str(error)) from error
    if first is None:
        raise SourceError(f"{where}: no samples in it")
    each: list[Iterable[Reading]] = [chain((first,), samples), speeds]
    readings = heapq.merge(*each, key=lambda reading: reading.time_ns)
    return Source(readings, first.time_ns, None)


def _speeds(kind: str, where: str, mount: MountName) -> Iterable[SpeedReading]:
    """Return what a vehicle's phone was told of its speed; nothing of any other source."""
    if (kind, mount) != ("phone", "vehicle"):
        return ()
    from edge_agent.sources.phone_export import read_phone_speeds  # noqa: PLC0415

    return read_phone_speeds(Path(where))


def _samples(kind: str, where: str, mount: MountName) -> Iterable[ImuSample]:
    if kind == "csv":
        from edge_agent.sources.vendor_csv import read_vendor_csv  # noqa: PLC0415

        return read_vendor_csv(Path(where))
    if kind == "phone":
        from edge_agent.sources.phone_export import read_phone_export  # noqa: PLC0415

        return read_phone_export(Path(where), needs_gyro=mount not in WITHOUT_GYRO)
    if kind == "npz":
        from edge_agent.sources.npz_set import read_npz_set  # noqa: PLC0415

        return read_npz_set(Path(where), needs_gyro=mount not in WITHOUT_GYRO).recording
    from edge_agent.sources.mcap_recording import read_imu_samples  # noqa: PLC0415

    path, _, responder_id = where.partition("#")
    return read_imu_samples(Path(path), responder_id or None)
