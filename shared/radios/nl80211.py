"""A Wi-Fi interface of this machine, asked over netlink for the stations that it hears."""

from __future__ import annotations

import errno
import socket
import sys
from collections.abc import Callable, Iterable
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType
from typing import NamedTuple, Protocol

from shared.radios.nl80211_stations import Attributes, polled_station
from shared.radios.readings import ScannerError
from shared.radios.station_counters import Polled

INTERFACES = Path("/sys/class/net")
MOST_TRIES = 3
"""The kernel breaks a dump off when stations come and go meanwhile."""

_NOT_PERMITTED = "not permitted; run as root, or give the program CAP_NET_ADMIN"
_ADVICE = {
    errno.ENOENT: "this kernel has no Wi-Fi (nl80211); plug the adapter in, and load its driver",
    errno.EOPNOTSUPP: "its driver does not tell of stations; use another adapter, or hostapd:",
    errno.EPERM: _NOT_PERMITTED,
    errno.EACCES: _NOT_PERMITTED,
}


class Wireless(Protocol):
    """The kernel's Wi-Fi, over a socket."""

    def get_stations(self, ifindex: int) -> Iterable[Attributes]:
        """Return the answers of a station dump."""

    def close(self) -> None:
        """Close the socket."""


class Netlink(NamedTuple):
    """An open socket; what it raises when it is refused, and when a dump was broken off."""

    wireless: Wireless
    refused: tuple[type[Exception], ...]
    interrupted: type[Exception]


class Nl80211Radio:
    """The stations of one interface: of an access point, or of a mesh."""

    def __init__(self, interface: str, open_netlink: Callable[[], Netlink] | None = None) -> None:
        """Raise ``ScannerError`` where there is no such interface, or no asking it."""
        self._index = _index_of(interface)
        self._netlink = (open_netlink or _open_pyroute2)()

    def poll(self) -> list[Polled]:
        """Return what is known of each station; ``OSError`` when the interface is gone."""
        wireless, refused, interrupted = self._netlink
        for _ in range(MOST_TRIES):
            try:
                told = [polled_station(answer) for answer in wireless.get_stations(self._index)]
            except interrupted:
                continue
            except refused as error:
                raise _as_os_error(error) from error
            return [station for station in told if station is not None]
        raise InterruptedError(errno.EINTR, "the stations come and go too fast to be listed")

    def close(self) -> None:
        """Close the socket."""
        self._netlink.wireless.close()


def _index_of(interface: str) -> int:
    try:
        return socket.if_nametoindex(interface)
    except OSError:
        there = ", ".join(sorted(path.parent.name for path in INTERFACES.glob("*/phy80211")))
        raise ScannerError(
            f"nl80211:{interface}: no such interface; of Wi-Fi there are: {there or 'none'}"
        ) from None


def _open_pyroute2() -> Netlink:
    _enter_lean("pyroute2")
    try:
        from pyroute2.iwutil import IW  # noqa: PLC0415
        from pyroute2.netlink.exceptions import (  # noqa: PLC0415
            NetlinkDecodeError,
            NetlinkDumpInterrupted,
            NetlinkError,
        )
    except ImportError as error:
        raise ScannerError(f"nl80211: pyroute2 is missing ({error}); install it") from None
    try:
        return Netlink(IW(), (NetlinkError, NetlinkDecodeError), NetlinkDumpInterrupted)
    except NetlinkError as error:
        raise ScannerError(f"nl80211: {_as_os_error(error).strerror}") from None


def _enter_lean(package: str) -> None:
    """Have only those modules of ``package`` loaded that are imported by name.

    Its own ``__init__`` loads all that it can do, 8 MB of it, where one module does.
    """
    found = find_spec(package) if package not in sys.modules else None
    if found is not None and found.submodule_search_locations is not None:
        bare = ModuleType(package)
        bare.__path__ = list(found.submodule_search_locations)
        bare.__spec__ = found
        sys.modules[package] = bare


def _as_os_error(error: Exception) -> OSError:
    """Return a netlink refusal as what it is, in words that say what to do."""
    code = getattr(error, "code", None)
    known = isinstance(code, int)
    return OSError(code if known else errno.EBADMSG, _ADVICE.get(code or 0, str(error)))
