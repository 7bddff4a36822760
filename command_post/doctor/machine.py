"""The machine: its clock, its Python, and whether machine code has been built."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from importlib.metadata import PackageNotFoundError, requires, version

from command_post.doctor.finding import Finding, fault, ok, warning
from command_post.fusion.team.elimination import reduce_to_arrow
from shared.bus.zenoh_bus import open_zenoh
from shared.clock import PacedClock, SystemClock
from shared.compiled import is_kept
from shared.messages import NodeId
from shared.security.bundle import Bundle
from shared.time_service import TimeAsker
from shared.units import NS_PER_S

OLDEST_PYTHON = (3, 11)
BUILT_NS = 1_750_000_000 * NS_PER_S
"""No clock that is set reads less: the program is younger."""

LATEST_NS = 4_000_000_000 * NS_PER_S
OFF_S = 2.0
ANSWERED_S = 4.0
POLL_S = 0.1
NTP_S = 2.0
"""How long the system may take to say whether its clock is kept."""


def check_clock(now_ns: int) -> Iterator[Finding]:
    """Yield whether the clock is set, and kept."""
    if not BUILT_NS < now_ns < LATEST_NS:
        year = 1970 + now_ns // (31_556_952 * NS_PER_S)
        yield fault("clock", f"not set: it reads the year {year}", "set it: 'date -s', or by NTP")
        return
    yield ok("clock", "set")
    synchronised = _synchronised()
    if synchronised is False:
        yield warning(
            "clock",
            "not kept by NTP or GNSS",
            "set it by hand before the incident; nodes follow the post's clock, right or wrong",
        )
    elif synchronised:
        yield ok("clock", "kept by NTP")


def check_post_clock(endpoint: str, bundle: Bundle | None, incident: NodeId) -> Finding:
    """Return how far the clock of a post that answers at ``endpoint`` is from this one."""
    about = f"clock of the post at {endpoint}"
    clock = PacedClock(SystemClock())
    with open_zenoh("client", connect=[endpoint], bundle=bundle) as bus:
        asker = TimeAsker(bus, incident, clock)
        end_ns = clock.now_ns() + round(ANSWERED_S * NS_PER_S)
        while not asker.ask() and clock.now_ns() < end_ns:
            time.sleep(POLL_S)
        stated = asker.stated()
    if stated is None:
        return warning(
            about, f"nobody tells the time for incident {incident!r}", "give --incident, or --id"
        )
    offset_s = stated.offset.offset_ns / NS_PER_S
    sd_s = stated.offset.uncertainty_ns / NS_PER_S
    said = f"{abs(offset_s):.3f} s {'ahead' if offset_s > 0 else 'behind'}, give or take {sd_s:.3f}"
    if abs(offset_s) > OFF_S:
        return warning(about, said, "set one of the clocks; tracks are right all the same")
    return ok(about, said)


def check_packages() -> Iterator[Finding]:
    """Yield whether Python and what the program needs are there."""
    here = ".".join(map(str, sys.version_info[:3]))
    if sys.version_info < OLDEST_PYTHON:
        yield fault("python", f"{here} is too old", "use 3.11 or newer")
    else:
        yield ok("python", here)
    missing = []
    for requirement in requires("clew") or ():
        name = re.split(r"[^A-Za-z0-9._-]", requirement, maxsplit=1)[0]
        if "extra ==" not in requirement:
            try:
                version(name)
            except PackageNotFoundError:
                missing.append(name)
    if missing:
        yield fault("packages", f"missing: {', '.join(missing)}", "pip install it anew")
    else:
        yield ok("packages", f"clew {version('clew')}, eclipse-zenoh {version('eclipse-zenoh')}")


def check_machine_code() -> Finding:
    """Return whether the post would have to build machine code when it starts."""
    if is_kept(reduce_to_arrow):
        return ok("machine code", "built")
    return warning(
        "machine code", "not built: the first start takes a minute", "'command-post prepare'"
    )


def _synchronised() -> bool | None:
    """Say whether the system keeps its clock by others; ``None`` if it does not say."""
    program = shutil.which("timedatectl")
    if program is None:
        return None
    try:
        asked = subprocess.run(  # noqa: S603
            [program, "show", "--property=NTPSynchronized", "--value"],
            capture_output=True, text=True, timeout=NTP_S, check=False,
        )  # fmt: skip
    except (OSError, subprocess.TimeoutExpired):
        return None
    return {"yes": True, "no": False}.get(asked.stdout.strip())
