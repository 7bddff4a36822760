"""A post's page with a crowd on it, and nothing else of a post: a real page, made-up estimates.

A thread does what the post's would: it says where everybody is, so many times a second each, and
four times a second who they are. What that costs it and the page's own process, and how late it
comes to it because others in its process are at work, is told at the end.
"""

from __future__ import annotations

import math
import os
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing import get_context
from multiprocessing.connection import Connection
from pathlib import Path
from typing import NamedTuple

from command_post.listening import Address
from command_post.roster import DapRow, ResponderRow, Roster
from command_post.web.handover import MOST_TRACKS
from command_post.web.page_process import PageProcess
from command_post.web.server import page_served
from shared.codec import encode
from shared.messages import FloorShare, LocalPosition, TrackEstimate, TrackStatus
from shared.units import NS_PER_S
from tests.waiting import wait_for

KEY = "clew/v1/crowd/post/post/track"
ROSTER_S = 0.25
STOREYS, STOREY_M = 4, 3.2
SPEED_M_S = 1.0
WALKED_S = 170
"""For so long everybody has walked before anybody looks: the ways behind them are full."""

STATUSES: tuple[TrackStatus, ...] = ("tracking",) * 8 + ("dead_reckoning", "recovering")


class Cost(NamedTuple):
    """What ``said`` estimates cost: the post's process, its thread, and the page's process.

    ``late_s`` are the median, the 99th percentile and the longest of how late the post's thread
    came to what it had to say.
    """

    lasted_s: float
    process_cpu_s: float
    post_cpu_s: float
    page_cpu_s: float
    said: int
    late_s: tuple[float, float, float]


def where(number: int, time_s: float) -> tuple[float, float, float]:
    """Return where the responder of that number walks (m): round a corridor of their own size."""
    long_m, wide_m = 20.0 + 3.0 * (number % 10), 8.0 + 2.0 * (number // 10 % 5)
    along_m = (SPEED_M_S * time_s + 7.3 * number) % (2.0 * (long_m + wide_m))
    sides_m = (long_m, wide_m, long_m, wide_m)
    north_m, east_m, bearing = 10.0 * (number // 20 % 5), 14.0 * (number % 20), 0
    for side_m in sides_m:
        step_m = min(along_m, side_m)
        north_m += step_m * (1, 0, -1, 0)[bearing]
        east_m += step_m * (0, 1, 0, -1)[bearing]
        along_m -= step_m
        bearing += along_m > 0.0
    return north_m, east_m, -STOREY_M * (number % STOREYS)


def track(number: int, time_ns: int, at_s: float) -> bytes:
    """Return a responder's estimate; every tenth is one of two regions, with outlines."""
    north_m, east_m, down_m = where(number, at_s)
    circle = [(2.0 * math.cos(a / 3.2), 2.0 * math.sin(a / 3.2)) for a in range(20)]
    outlines = tuple(
        tuple((north_m + side + n, east_m + e) for n, e in circle) for side in (-4.0, 4.0)
    )
    return encode(
        TrackEstimate(
            event_time_ns=time_ns, sequence=0, responder_id=f"r{number}", north_m=north_m,
            east_m=east_m, down_m=down_m, covariance_m2=(1.5, 0.4 * math.sin(at_s), 0.8),
            heading_rad=at_s % math.tau - math.pi, heading_sd_rad=0.2, down_sd_m=0.4,
            last_proximity_time_ns=None, floors=(FloorShare(down_m, 0.9),),
            status=STATUSES[number % len(STATUSES)],
            regions_m=outlines if number % 10 == 0 else (),
        )
    )  # fmt: skip


def roster(responders: int, now_ns: int) -> Roster:
    """Return who they are, with access points among them."""
    rows = tuple(
        ResponderRow(
            f"r{number}", "tracking", "", None, (2.0, 1.0), 0.1, 5.0, None, "walking", None
        )
        for number in range(responders)
    )  # fmt: skip
    spots = [(14.0 * (n % 20), 40.0 * (n // 20)) for n in range(responders // 10)]
    daps = tuple(
        DapRow(f"dap{n}", "installed", "", LocalPosition(
            north_m=north_m, east_m=east_m, down_m=-STOREY_M * (n % STOREYS),
            covariance_m2=(0.1, 0.0, 0.1)), (0.5, 0.5), 0.1, None, None)
        for n, (east_m, north_m) in enumerate(spots)
    )  # fmt: skip
    return Roster(now_ns, rows, daps)


class _Crowd(threading.Thread):
    """The post's thread."""

    def __init__(self, page: PageProcess, responders: int, rate_hz: float) -> None:
        super().__init__(name="post")
        self._page, self._responders, self._rate_hz = page, responders, rate_hz
        self.stop = threading.Event()
        self.said, self.cpu_s = 0, 0.0
        self.late_s: list[float] = []

    def walk_before(self) -> None:
        """Have everybody come from somewhere."""
        now_ns = time.time_ns()
        for second in range(WALKED_S * 2):
            for number in range(self._responders):
                at_s = 0.5 * second - 0.5 * 2 * WALKED_S
                self._page.published(KEY, track(number, now_ns + round(at_s * NS_PER_S), at_s))
            wait_for(lambda: self._page.waiting < MOST_TRACKS // 2, "the page to be told")
        self._page.show(roster(self._responders, now_ns))

    def run(self) -> None:
        """Say where one after another is, evenly spread over the time."""
        gap_s = 1.0 / (self._rate_hz * self._responders)
        began_s = next_roster_s = time.monotonic()
        while not self.stop.is_set():
            due_s = began_s + self.said * gap_s
            wait_s = due_s - time.monotonic()
            if wait_s > 0.0 and self.stop.wait(wait_s):
                return
            self.late_s.append(time.monotonic() - due_s)
            message = track(self.said % self._responders, time.time_ns(), due_s - began_s)
            self._page.published(KEY, message)
            self.said += 1
            if due_s >= next_roster_s:
                self._page.show(roster(self._responders, time.time_ns()))
                next_roster_s += ROSTER_S
            self.cpu_s = time.thread_time()

    def cost_of(self, count: int) -> Cost:
        """Return what it costs to say ``count`` further estimates."""
        self.late_s.clear()
        before = self._spent()
        wait_for(lambda: self.said >= before.said + count, "all to be said", 60.0 + count / 100.0)
        spent, late_s = self._spent(), sorted(self.late_s)
        ranks = (len(late_s) // 2, len(late_s) * 99 // 100, len(late_s) - 1)
        middle_s, most_s, worst_s = (late_s[rank] for rank in ranks)
        return Cost(
            spent.lasted_s - before.lasted_s,
            spent.process_cpu_s - before.process_cpu_s,
            spent.post_cpu_s - before.post_cpu_s,
            spent.page_cpu_s - before.page_cpu_s,
            spent.said - before.said,
            (middle_s, most_s, worst_s),
        )

    def _spent(self) -> Cost:
        page_s = cpu_s_of(self._page.process_id)
        none = (0.0, 0.0, 0.0)
        return Cost(time.monotonic(), time.process_time(), self.cpu_s, page_s, self.said, none)


def cpu_s_of(process_id: int | None) -> float:
    """Return the processor time that another process has spent; 0 if there is none."""
    if process_id is None:
        return 0.0
    fields = Path(f"/proc/{process_id}/stat").read_text().rpartition(") ")[2].split()
    return sum(map(int, fields[11:13])) / os.sysconf("SC_CLK_TCK")


def _serve(responders: int, rate_hz: float, pipe: Connection) -> None:
    with socket.create_server(("127.0.0.1", 0)) as free:
        address = Address(*free.getsockname())
    with page_served(address, "crowd", "post", None, None) as page:
        if page is None:
            raise RuntimeError("a page is served where there is an address")
        crowd = _Crowd(page, responders, rate_hz)
        crowd.walk_before()
        crowd.start()
        pipe.send(address.port)
        seconds: float = pipe.recv()
        pipe.send(crowd.cost_of(round(seconds * rate_hz * responders)))
        crowd.stop.set()
        crowd.join()


class Served:
    """A crowded page; ``begin`` and ``end`` enclose what is measured."""

    def __init__(self, pipe: Connection) -> None:
        self._pipe = pipe
        self.url = f"http://127.0.0.1:{pipe.recv()}/"

    def begin(self, seconds: float) -> None:
        """Count from now on, until as much has been said as is in so long."""
        self._pipe.send(seconds)

    def end(self) -> Cost:
        """Say what it has cost, once it has been said."""
        cost: Cost = self._pipe.recv()
        return cost


@contextmanager
def crowded_page(responders: int, rate_hz: float) -> Iterator[Served]:
    """Serve a page with a crowd on it until the block ends."""
    spawning = get_context("spawn")
    ours, theirs = spawning.Pipe()
    process = spawning.Process(target=_serve, args=(responders, rate_hz, theirs))
    process.start()
    theirs.close()
    try:
        yield Served(ours)
    finally:
        ours.close()
        process.join(10.0)
        process.kill()
