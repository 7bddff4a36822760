"""A hostapd and a wpa_supplicant to test with: control interfaces over real UNIX sockets."""

from __future__ import annotations

import socket
import threading
from pathlib import Path
from typing import Self


class FakeControl:
    """Answers at ``path``, and tells those who are attached of events."""

    def __init__(self, path: Path) -> None:
        self.asked: list[str] = []
        self.deaf = False
        """Whether it answers nothing, as a program that hangs."""

        self._path = path
        self._attached: list[bytes] = []
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._socket.bind(str(path))
        self._thread = threading.Thread(target=self._serve)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as own:
            own.sendto(b"END", str(self._path))
        self._thread.join()
        self._socket.close()
        self._path.unlink()

    def say(self, event: str) -> None:
        """Send an event to whoever is attached."""
        for address in self._attached:
            self._socket.sendto(f"<3>{event}".encode(), address)

    def _serve(self) -> None:
        while True:
            raw, address = self._socket.recvfrom(4096)
            command = raw.decode()
            if command == "END":
                return
            self.asked.append(command)
            if command == "ATTACH":
                self._attached.append(address)
            if not self.deaf:
                self._socket.sendto(self._answer(command).encode(), address)

    def _answer(self, command: str) -> str:
        return "OK\n" if command == "ATTACH" else "UNKNOWN COMMAND\n"


class FakeHostapd(FakeControl):
    """Answers as hostapd does; ``stations`` are its stations' lines, by address."""

    def __init__(self, path: Path) -> None:
        self.stations: dict[str, dict[str, int]] = {}
        self.busy = False
        """Whether each station sends a packet between two looks at it."""

        super().__init__(path)

    def _answer(self, command: str) -> str:
        addresses = list(self.stations)
        match command.split():
            case ["STA-FIRST"]:
                return self._station(addresses[0]) if addresses else ""
            case ["STA-NEXT", address] if address in addresses:
                after = addresses[addresses.index(address) + 1 :]
                return self._station(after[0]) if after else ""
            case ["STA-NEXT", _]:
                return "FAIL\n"
            case _:
                return super()._answer(command)

    def _station(self, address: str) -> str:
        self.stations[address]["rx_packets"] += self.busy
        told = {"flags": "[AUTH][ASSOC]", "aid": 1, **self.stations[address]}
        lines = [address, *(f"{name}={value}" for name, value in told.items())]
        return "".join(f"{line}\n" for line in lines)


class FakeWpa(FakeControl):
    """Answers as wpa_supplicant does; ``link`` is the BSSID it is linked to, and its signal."""

    def __init__(self, path: Path) -> None:
        self.link: tuple[str, int] | None = None
        self.found: dict[str, int] = {}
        super().__init__(path)

    def _answer(self, command: str) -> str:
        match command:
            case "STATUS" if self.link is not None:
                return f"bssid={self.link[0]}\nfreq=2437\nssid=clew=1\nwpa_state=COMPLETED\n"
            case "STATUS":
                return "wpa_state=SCANNING\n"
            case "SIGNAL_POLL" if self.link is not None:
                return f"RSSI={self.link[1]}\nLINKSPEED=54\nNOISE=9999\nFREQUENCY=2437\n"
            case "SIGNAL_POLL":
                return "FAIL\n"
            case "SCAN_RESULTS":
                lines = (f"{at}\t2437\t{dbm}\t[ESS]\tclew\n" for at, dbm in self.found.items())
                return "bssid / frequency / signal level / flags / ssid\n" + "".join(lines)
            case _:
                return super()._answer(command)
