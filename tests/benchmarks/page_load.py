"""How fast the commander's page is with a crowd on it.

``python -m tests.benchmarks.page_load --responders 200 --hz 10 --browsers 20 --drawn 2`` serves a
page of so many responders and looks at it with so many browsers at once: ``drawn`` of them are
headless Chromium, which draw it, the others only take what they are sent, as fast as it comes. It
prints JSON: frames a second and how late the frames are, how long after the post has said it an
estimate is drawn (the frame that shows it is done; what the screen takes is not in it), how long
until it is received, what that costs the post, and how late the post's thread comes to what it has
to say. What that is with ``--browsers 0`` is the machine's.

Chromium draws without a graphics card here, and on the processors that the post has as well: give
it a machine of its own for figures of either.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import os
import statistics
import sys
import threading
import time
from collections.abc import Sequence
from contextlib import suppress
from itertools import pairwise
from pathlib import Path
from urllib.parse import urlsplit

import msgspec
from playwright.sync_api import Page, ViewportSize

from command_post.web.board import TrackView
from shared.units import NS_PER_MS
from tests.benchmarks.page_crowd import Cost, Served, crowded_page
from tests.web.browser import chromium

METER = Path(__file__).with_name("page_meter.js")
SIZE = ViewportSize(width=1920, height=1080)
LOADED_MS = 60_000
SETTLED = "clewMeter.messages >= 40 && clewMeter.late_ms.length > 0"
LOOK_MS = 200


class Told(msgspec.Struct):
    """Of what is told, what is looked at here."""

    tracks: list[TrackView] = []


class Listeners(threading.Thread):
    """Browsers that draw nothing, each with a connection of its own."""

    def __init__(self, url: str, count: int) -> None:
        super().__init__(name="listeners")
        self._url, self._count = urlsplit(url), count
        self.counts = False
        self.late_ms: list[float] = []
        self.received_bytes = 0
        self._hang_up = threading.Event()

    def run(self) -> None:
        """Listen until stopped."""
        asyncio.run(self._run())

    def stop(self) -> None:
        """Hang up."""
        self._hang_up.set()
        self.join()

    async def _run(self) -> None:
        await asyncio.gather(*(self._listen() for _ in range(self._count)))

    async def _listen(self) -> None:
        host, port = self._url.hostname, self._url.port
        reader, writer = await asyncio.open_connection(host, port, limit=1 << 26)
        request = f"GET /api/v1/events HTTP/1.1\r\nHost: {host}:{port}\r\n\r\n"
        writer.write(request.encode())
        while not self._hang_up.is_set():
            line = await reader.readline()
            if self.counts and line.startswith(b"data: "):
                now_ms = time.time_ns() / NS_PER_MS
                self.received_bytes += len(line)
                tracks = msgspec.json.decode(line[6:], type=Told).tracks
                self.late_ms += [now_ms - each.time_ns / NS_PER_MS for each in tracks]
        writer.close()


def chromium_cpu_s() -> float:
    """Return the processor time that all processes of Chromium on this machine have spent."""
    ticks = 0
    for status in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):
            name, _, fields = status.read_text().partition(") ")
            if name.endswith("(chromium"):
                ticks += sum(map(int, fields.split()[11:13]))
    return ticks / os.sysconf("SC_CLK_TCK")


def spread(values: Sequence[float]) -> dict[str, float]:
    """Return the median, the 95th percentile and the most of ``values``."""
    if len(values) < 2:
        return {}
    twentieths = statistics.quantiles(values, n=20)
    return {
        "p50": round(twentieths[9], 1), "p95": round(twentieths[18], 1), "most": round(max(values))
    }  # fmt: skip


def measure(served: Served, browsers: int, drawn: int, seconds: float) -> dict[str, object]:
    """Look at a page with so many browsers, ``drawn`` of them real, and tell how that went."""
    listeners = Listeners(served.url, browsers - drawn)
    listeners.start()
    with chromium() as browser:
        # A window each: what lies behind another window is hardly drawn.
        pages = [browser.new_page(viewport=SIZE, bypass_csp=True) for _ in range(drawn)]
        for page in pages:
            page.add_init_script(path=METER)
            page.goto(served.url)
        for page in pages:
            page.wait_for_function(SETTLED, timeout=LOADED_MS, polling=LOOK_MS)
        served.begin(seconds)
        listeners.counts = True
        browsers_cpu_s = chromium_cpu_s()
        for page in pages:
            page.evaluate("for (const kept of Object.values(clewMeter)) kept.length = 0;"
                          "clewMeter.messages = clewMeter.renders = 0")  # fmt: skip
        cost = served.end()
        shown = [_shown(page) for page in pages]
        browsers_cpu_s = chromium_cpu_s() - browsers_cpu_s
        listeners.counts = False
    listeners.stop()
    listened = {
        "received_ms": spread(listeners.late_ms),
        "kb_a_second_each": round(
            listeners.received_bytes / 1e3 / cost.lasted_s / max(browsers - drawn, 1)
        ),
    }
    cores = round(browsers_cpu_s / cost.lasted_s, 2)
    return {"drawn": shown, "their_cores": cores, "listened": listened, "post": _post(cost)}


def _shown(page: Page) -> dict[str, object]:
    meter = page.evaluate("clewMeter")
    frames_ms: list[float] = meter["frames_ms"]
    gaps_ms = [b - a for a, b in pairwise(frames_ms)]
    lasted_s = (frames_ms[-1] - frames_ms[0]) / 1e3
    return {
        "frames_a_second": round(len(gaps_ms) / lasted_s, 1),
        "frame_ms": spread(gaps_ms),
        "drawn_ms": spread(meter["late_ms"]),
        "estimates_drawn_a_second": round(len(meter["late_ms"]) / lasted_s),
        "messages_a_second": round(meter["messages"] / lasted_s, 1),
        "renders_a_second": round(meter["renders"] / lasted_s, 1),
        "busy_over_50_ms": len(meter["long_ms"]),
    }


def _post(cost: Cost) -> dict[str, object]:
    middle_s, most_s, worst_s = cost.late_s
    return {
        "said_a_second": round(cost.said / cost.lasted_s),
        "share_of_a_core": round(cost.process_cpu_s / cost.lasted_s, 2),
        "of_it_the_posts_thread": round(cost.post_cpu_s / cost.lasted_s, 2),
        "the_pages_process": round(cost.page_cpu_s / cost.lasted_s, 2),
        "late_ms": {
            "p50": round(1e3 * middle_s, 2), "p99": round(1e3 * most_s, 1),
            "most": round(1e3 * worst_s),
        },
    }  # fmt: skip


def main() -> None:
    """Measure as the arguments say, and print it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--responders", type=int, default=200)
    parser.add_argument("--hz", type=float, default=10.0)
    parser.add_argument("--browsers", type=int, default=1)
    parser.add_argument("--drawn", type=int, default=1)
    parser.add_argument("--seconds", type=float, default=15.0)
    given = parser.parse_args()
    with crowded_page(given.responders, given.hz) as served:
        told = measure(served, given.browsers, min(given.drawn, given.browsers), given.seconds)
    sys.stdout.write(json.dumps(told, indent=1) + "\n")


if __name__ == "__main__":
    main()
