"""An access point's stations, as the hostapd that runs it tells of them."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import structlog

from shared.messages import StationAddress
from shared.radios.hostapd_stations import polled_station
from shared.radios.readings import ScannerError
from shared.radios.station_counters import Polled
from shared.wpa_control import ControlSocket

ENDED = ("CTRL-EVENT-TERMINATING", "AP-DISABLED", "INTERFACE-DISABLED")

_log = structlog.stdlib.get_logger(__name__)


class HostapdRadio:
    """The stations of one access point, over its control socket."""

    def __init__(self, path: Path) -> None:
        """Raise ``ScannerError`` where no hostapd answers at ``path``."""
        try:
            self._control = ControlSocket(path)
        except PermissionError:
            raise ScannerError(
                f"hostapd:{path}: not permitted; run in the group that hostapd's "
                "ctrl_interface_group names"
            ) from None
        except OSError as error:
            raise ScannerError(
                f"hostapd:{path}: no hostapd answers ({error.strerror or error}); its "
                "configuration needs ctrl_interface=/run/hostapd, and WHERE is that and the "
                "interface, as in hostapd:/run/hostapd/wlan0"
            ) from None

    def poll(self) -> Iterator[Polled]:
        """Yield what is known of each station; ``OSError`` when hostapd has ended."""
        for event in self._control.take_events():
            self._heed(event)
        seen: set[StationAddress] = set()
        answer = self._control.request("STA-FIRST")
        # The list may change while it is gone through.
        while (station := polled_station(answer)) is not None and station.address not in seen:
            seen.add(station.address)
            yield station
            answer = self._control.request(f"STA-NEXT {station.address}")

    def close(self) -> None:
        """Close the connection."""
        self._control.close()

    def _heed(self, event: str) -> None:
        what = event.partition(" ")[0]
        if what in ENDED:
            raise ConnectionResetError(f"hostapd says {what}")
        if what in ("AP-STA-CONNECTED", "AP-STA-DISCONNECTED"):
            _log.debug("a station comes" if what.endswith("-CONNECTED") else "a station goes")
