"""Recorded dumps: what a radio heard, as JSON lines.

A line is a reading, ``{"time_ns": 1700000000200000000, "station": "02:00:5e:10:00:01",
"rssi_dbm": -47.0}``, with ``age_ms``, ``average_dbm``, ``chains_dbm`` and ``aliases`` where they
are known; or a scan that heard nobody, ``{"time_ns": 1700000000400000000}``. Lines of one time are
one scan, and times do not go back.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import groupby
from pathlib import Path
from typing import Annotated

import msgspec
import structlog
from msgspec import Meta

from shared.messages import PowerDbm, TimeNs
from shared.radios.readings import RadioScan, Reading, ScannerError
from shared.stations import Stations, parse_address
from shared.units import NS_PER_MS

EMPTY_SCAN_NS = 250_000_000
"""Where nothing was heard for longer, empty scans say that time went by."""

LONGEST_PAUSE_NS = 60_000_000_000
"""A pause is this long at most when it is played: the recorder was stopped meanwhile."""

_log = structlog.stdlib.get_logger(__name__)


class Line(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True):
    """One line of a dump."""

    time_ns: TimeNs
    station: str | None = None
    rssi_dbm: PowerDbm | None = None
    age_ms: Annotated[float, Meta(ge=0.0, le=1e6)] = 0.0
    average_dbm: PowerDbm | None = None
    chains_dbm: Annotated[tuple[PowerDbm, ...], Meta(max_length=16)] = ()
    aliases: tuple[str, ...] = ()


_decoder = msgspec.json.Decoder(Line)
_encoder = msgspec.json.Encoder()


def as_lines(scan: RadioScan) -> bytes:
    """Return a scan as the lines of a dump."""
    lines = [
        Line(
            time_ns=scan.time_ns,
            station=reading.address,
            rssi_dbm=reading.rssi_dbm,
            age_ms=reading.age_ns / NS_PER_MS,
            average_dbm=reading.average_dbm,
            chains_dbm=reading.chains_dbm,
            aliases=reading.aliases,
        )
        for reading in scan.readings
    ]
    return _encoder.encode_lines(lines or [Line(time_ns=scan.time_ns)])


def read_dump(path: Path) -> list[RadioScan]:
    """Return the scans of the dump at ``path``, in the order of time.

    A last line that was cut off is left out, and said. Raises ``ScannerError``, which names the
    line, where the file cannot be read or is not a dump.
    """
    try:
        text = path.read_bytes()
    except OSError as error:
        raise ScannerError(f"{path}: cannot be read ({error.strerror}); give another") from None
    *whole, rest = text.split(b"\n")
    if rest:
        _log.warning("the last line of the dump is cut off, and left out", file=str(path))
    lines = list(_lines(path, whole))
    if not lines:
        raise ScannerError(f"{path}: no whole line in it; 'dap-node record' makes a dump")
    return [
        RadioScan(time_ns, tuple(reading for _, reading in group if reading is not None))
        for time_ns, group in groupby(lines, key=lambda line: line[0])
    ]


def played(scans: list[RadioScan], begin_ns: int) -> Iterator[RadioScan]:
    """Yield ``scans`` so that the first is at ``begin_ns``, with empty ones in between."""
    at_ns, before_ns = begin_ns, scans[0].time_ns
    for scan in scans:
        next_ns = at_ns + min(scan.time_ns - before_ns, LONGEST_PAUSE_NS)
        for empty_ns in range(at_ns + EMPTY_SCAN_NS, next_ns, EMPTY_SCAN_NS):
            yield RadioScan(empty_ns, ())
        at_ns, before_ns = next_ns, scan.time_ns
        yield scan._replace(time_ns=at_ns)


def only_known(scan: RadioScan, known: Stations) -> RadioScan:
    """Return a scan without the radios that are on no table."""
    readings = (reading for reading in scan.readings if known.whose(*reading.names) is not None)
    return scan._replace(readings=tuple(readings))


def _lines(path: Path, lines: list[bytes]) -> Iterator[tuple[int, Reading | None]]:
    """Yield the time of each line, and what was heard if anything was."""
    last_ns = 0
    for number, text in enumerate(lines, 1):
        if not text.strip():
            continue
        try:
            line = _decoder.decode(text)
            reading = _reading(line)
            if line.time_ns < last_ns:
                raise ValueError("time_ns is before that of the line before")
        except (ValueError, UnicodeDecodeError) as error:
            raise ScannerError(f"{path}: line {number}: {error}; correct it") from None
        last_ns = line.time_ns
        yield line.time_ns, reading


def _reading(line: Line) -> Reading | None:
    if line.station is None:
        return None
    if line.rssi_dbm is None:
        raise ValueError("a station without rssi_dbm")
    return Reading(
        parse_address(line.station), line.rssi_dbm, round(line.age_ms * NS_PER_MS),
        line.average_dbm, line.chains_dbm, tuple(map(parse_address, line.aliases)),
    )  # fmt: skip
