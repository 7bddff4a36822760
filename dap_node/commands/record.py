"""``dap-node record``: what radios hear, into a file, to be played and evaluated later."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import structlog
from cyclopts import Parameter, validators

from dap_node.scanners.dump import as_lines, only_known
from dap_node.scanners.live import live_observations
from shared.clock import SystemClock
from shared.process import ExitCode, stop_on_signals
from shared.radios.live import SCAN_RATE_HZ
from shared.radios.opening import open_radios
from shared.radios.readings import RadioScan
from shared.stations import Stations, read_stations
from shared.units import NS_PER_S

_log = structlog.stdlib.get_logger(__name__)


def record(
    output: Path,
    *,
    source: Annotated[tuple[str, ...], Parameter(consume_multiple=False)],
    stations: Path | None = None,
    everybody: Annotated[bool, Parameter(negative="")] = False,
    scan_rate: Annotated[float, Parameter(validator=validators.Number(gt=0.0, lte=50.0))] = (
        SCAN_RATE_HZ
    ),
    seconds: Annotated[float | None, Parameter(validator=validators.Number(gt=0.0))] = None,
) -> int:
    """Write what radios hear to a file, until SIGINT or SIGTERM.

    Example: dap-node record walk.jsonl --source nl80211:wlan0 --stations stations.toml

    Parameters
    ----------
    output
        The file, JSON lines (docs/dap.md); its name must be free. 'dap-node run --source
        recorded:FILE' plays it.
    source
        nl80211:INTERFACE, hostapd:SOCKET or ble:ADAPTER, as many as there are, one an option.
    stations
        Only radios in this table are written, TOML or CSV.
    everybody
        All that are heard are written, whoever's they are, in place of --stations.
    scan_rate
        How many times a second a Wi-Fi radio is asked.
    seconds
        End after so long.

    """
    try:
        if (stations is None) is not everybody:
            raise ValueError("give --stations FILE, or --everybody to write strangers' radios too")
        known = None if stations is None else Stations(read_stations(stations))
        sources = open_radios(source, "--source", rate_hz=scan_rate)
        with stop_on_signals() as stop, output.open("xb") as file:
            clock = SystemClock()
            until_ns = None if seconds is None else clock.now_ns() + round(seconds * NS_PER_S)
            lines = 0
            for scan in live_observations(sources, clock, stop):
                if until_ns is not None and scan.time_ns >= until_ns:
                    break
                if isinstance(scan, RadioScan):
                    written = scan if known is None else only_known(scan, known)
                    lines += len(written.readings)
                    file.write(as_lines(written))
                    file.flush()
    except FileExistsError:
        _log.error(f"{output}: is there already; give another name")
        return ExitCode.USAGE
    except ValueError as error:
        _log.error(str(error))
        return ExitCode.USAGE
    except OSError as error:
        _log.error(f"{output}: cannot be written ({error.strerror}); give another")
        return ExitCode.FAILURE
    _log.info("recorded", readings=lines, file=str(output))
    return ExitCode.OK
