"""Make the recordings anew: ``python -m tests.replay.renew_recordings``.

To be run when the simulator, the agents or the fusion have changed what they say on purpose. The
same code makes the same files, to the bit on one machine.
"""

from __future__ import annotations

import hashlib
import shlex
import sys
from typing import Any

import msgspec

from command_post.__main__ import app
from command_post.commands.scoring import read_evidence
from command_post.evaluation.errors import measure
from command_post.evaluation.score_card import Score, score
from shared.files import replace_atomically
from shared.mcap_reader import read_recording
from tests.conftest import CHECKOUT

RECORDINGS = CHECKOUT / "recordings"
MANIFEST = RECORDINGS / "manifest.json"


class Entry(msgspec.Struct, kw_only=True):
    """One recording: what it is, the command that makes it, its size, hash and score."""

    file: str
    what: str
    truth: str
    command: str
    size_bytes: int
    sha256: str
    messages: int
    score: Score


def entry(about: dict[str, str]) -> Entry:
    """Make the recording that ``about`` tells of, and say how it came out."""
    command = f"command-post rehearse {about['arguments']} --output recordings/{about['file']}"
    words: list[Any] = shlex.split(command)[1:]
    app([*words[:-1], str(CHECKOUT / words[-1]), "--replace"], result_action="return_value")
    path = RECORDINGS / about["file"]
    content = path.read_bytes()
    return Entry(
        file=about["file"],
        what=about["what"],
        truth="topic truth: each responder's boot ten times a second, each DAP every 10 s",
        command=command,
        size_bytes=len(content),
        sha256=hashlib.sha256(content).hexdigest(),
        messages=sum(1 for _ in read_recording(path)),
        score=score(measure(read_evidence(path))),
    )


ABOUT: tuple[dict[str, str], ...] = (
    {
        "file": "corridor.mcap",
        "what": "two responders, two DAPs, half a minute, with the raw samples of both boots",
        "arguments": "corridor --seed 1",
    },
    {
        "file": "four_daps.mcap",
        "what": "the published exercise: three responders, four DAPs; without raw samples",
        "arguments": "four_daps --seed 1 --no-imu",
    },
)


def main() -> None:
    """Renew every recording and the manifest."""
    entries = [entry(about) for about in ABOUT]
    with replace_atomically(MANIFEST) as file:
        file.write(msgspec.json.format(msgspec.json.encode(entries)) + b"\n")
    sys.stdout.write(f"{len(entries)} recordings renewed in {RECORDINGS}\n")


if __name__ == "__main__":
    main()
