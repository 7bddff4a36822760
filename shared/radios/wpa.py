"""The access points that a unit hears, as the wpa_supplicant that links it tells of them."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from shared.radios.readings import ScannerError
from shared.radios.station_counters import Polled
from shared.radios.wpa_results import linked_to, scanned
from shared.wpa_control import ControlSocket

SCANNED = "CTRL-EVENT-SCAN-RESULTS"
ENDED = "CTRL-EVENT-TERMINATING"


class WpaRadio:
    """The access point linked to, at every poll, and others whenever a scan has found them.

    Scans are wpa_supplicant's own (``bgscan``): each takes the radio away from its link.
    """

    def __init__(self, path: Path) -> None:
        """Raise ``ScannerError`` where no wpa_supplicant answers at ``path``."""
        try:
            self._control = ControlSocket(path)
        except PermissionError:
            raise ScannerError(
                f"wpa:{path}: not permitted; run in the group that ctrl_interface names"
            ) from None
        except OSError as error:
            raise ScannerError(
                f"wpa:{path}: no wpa_supplicant answers ({error.strerror or error}); its "
                "configuration needs ctrl_interface=/run/wpa_supplicant, and WHERE is that and the "
                "interface, as in wpa:/run/wpa_supplicant/wlan0"
            ) from None
        self._polls = 0

    def poll(self) -> Iterator[Polled]:
        """Yield what was heard since the last poll; ``OSError`` when wpa_supplicant has ended."""
        events = [event.partition(" ")[0] for event in self._control.take_events()]
        if ENDED in events:
            raise ConnectionResetError(f"wpa_supplicant says {ENDED}")
        # Beacons come ten times a second: each poll has heard some since the one before.
        self._polls += 1
        status, signal = (self._control.request(each) for each in ("STATUS", "SIGNAL_POLL"))
        link = linked_to(status, signal)
        if link is not None:
            yield Polled(link[0], (self._polls,), link[1])
        if SCANNED in events:
            for bssid, dbm in scanned(self._control.request("SCAN_RESULTS")):
                if link is None or bssid != link[0]:
                    yield Polled(bssid, (self._polls,), dbm)

    def close(self) -> None:
        """Close the connection."""
        self._control.close()
