"""How soon a long recording is open, and any moment of it is shown.

``python -m tests.benchmarks.review_recording --responders 50 --minutes 60`` records what so many
say (see ``long_recording``), opens it with ``command-post review``, asks for moments here and
there, and prints as JSON what that takes: from the start of the process, over HTTP.
"""

from __future__ import annotations

import argparse
import json
import re
import subprocess
import sys
import tempfile
import time
import urllib.request
from pathlib import Path
from typing import IO, Any

import numpy as np

from command_post.recorder.mirror import Mirror
from tests.benchmarks.long_recording import ORIGIN, record

SEEKS = 60
FRAMES = "step_s=6&count=20"
"""Two seconds of playing at 60×."""


def measured(path: Path) -> dict[str, Any]:
    """Return what opening it and going through it takes."""
    began_s = time.monotonic()
    command = [sys.executable, "-m", "command_post", "review", str(path), "--page", "127.0.0.1:0"]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as post:
        try:
            url = _url(post.stderr)
            _get(url)
            line = json.loads(_get(f"{url}api/v1/timeline"))
            _get(f"{url}api/v1/moment?at_s=0")
            opened_s = time.monotonic() - began_s
            length_s = line["length_s"]
            size = len(_get(f"{url}api/v1/moment?at_s={length_s}"))
            whole_s = time.monotonic() - began_s
            chance = np.random.default_rng(1)
            times_s = chance.uniform(0.0, length_s, SEEKS).tolist()
            moments_ms = _timed([f"{url}api/v1/moment?at_s={each}" for each in times_s])
            played_ms = _timed([f"{url}api/v1/moments?after_s={each}&{FRAMES}" for each in times_s])
        finally:
            post.terminate()
    return {
        "marks": len(line["marks"]),
        "open, s": round(opened_s, 2),
        "every moment can be shown after, s": round(whole_s, 2),
        "seek, ms: median, 95 %, most": moments_ms,
        "two seconds at 60×, ms: median, 95 %, most": played_ms,
        "kB of a moment": round(size / 1e3),
    }


def _url(said: IO[str] | None) -> str:
    for line in said or ():
        found = re.search(r"url=(http://\S+)", line)
        if found:
            return found[1]
    raise RuntimeError("the page was not served")


def _get(url: str) -> bytes:
    with urllib.request.urlopen(url, timeout=120.0) as answer:  # noqa: S310
        content: bytes = answer.read()
    return content


def _timed(urls: list[str]) -> list[float]:
    took_ms = []
    for url in urls:
        began_s = time.monotonic()
        _get(url)
        took_ms.append(1e3 * (time.monotonic() - began_s))
    return [round(float(each), 1) for each in (*np.percentile(took_ms, (50, 95)), max(took_ms))]


def main(words: list[str]) -> int:
    """Record it, or take one that is there; open it; print what that takes."""
    options = argparse.ArgumentParser(prog="python -m tests.benchmarks.review_recording")
    options.add_argument("--responders", type=int, default=50)
    options.add_argument("--minutes", type=float, default=60.0)
    options.add_argument("--recording", type=Path, default=None, help="open this one instead")
    given = options.parse_args(words)
    with tempfile.TemporaryDirectory(prefix="clew-review-") as folder:
        path = given.recording or Path(folder) / "long.mcap"
        if given.recording is None:
            record(path, given.responders, given.minutes, Mirror(ORIGIN))
        told = {"MB": round(path.stat().st_size / 1e6, 1), **measured(path)}
    print(json.dumps(told, indent=1, ensure_ascii=False))  # noqa: T201
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
