"""A post that one message kills, or holds up: its kernel is poisoned, here and nowhere else.

``python -m tests.faults.poisoned FOLDER kill`` serves the recording in FOLDER as ``command-post
run`` does, on a bus within the process, and hears two responders who walk, and a word of where one
is. Fusing that word kills the process, as a fault in machine code would, or with ``hang`` never
ends. What it gets over it prints: how many messages were handled, and what was put aside.
"""

from __future__ import annotations

import os
import signal
import sys
from pathlib import Path
from threading import Event, Thread

import numpy as np
import numpy.typing as npt

from command_post.fusion.methods import prepare_fusion
from command_post.handing_over import HandingOver
from command_post.incident import IncidentSettings
from command_post.post import Post
from command_post.recorder.recording import Recorder
from command_post.resuming import watcher
from command_post.resuming.resumption import Resumption
from shared.bus.interface import Received
from shared.bus.memory import MemoryNetwork
from shared.clock import ManualClock
from shared.codec import encode
from shared.compiled import compiled
from shared.messages import LocalPosition, Message, PositionFix
from shared.units import NS_PER_S
from tests.unit.test_post import NOW_NS, SETTINGS, START_NS, estimate_in, key, start, stride
from tests.waiting import wait_for

WALKED = 8
POISON = PositionFix(
    event_time_ns=NOW_NS - 5 * NS_PER_S, sequence=0, responder_id="r1", source="gnss",
    position=LocalPosition(north_m=1.0, east_m=0.0, down_m=0.0, covariance_m2=(0.1, 0.0, 0.1)),
)  # fmt: skip


@compiled
def stuck(flag: npt.NDArray[np.int64]) -> int:
    """Go round for as long as nobody sets the flag."""
    turns = 0
    while flag[0] == 0:
        turns += 1
    return turns


def poisoned(how: str, give: object, itself: HandingOver, node_id: str, message: Message) -> None:
    """Hand over what is no poison."""
    if isinstance(message, PositionFix) and how == "kill":
        os.kill(os.getpid(), signal.SIGKILL)
    elif isinstance(message, PositionFix) and how == "hang":
        stuck(np.zeros(1, np.int64))
    give(itself, node_id, message)  # type: ignore[operator]


def said() -> list[tuple[str, bytes]]:
    """Return what is said, the poison in the midst of it."""
    heard = [(key("start", node=name), start()) for name in ("r1", "r2")]
    for number in range(WALKED):
        heard += [(key("increment", node=name), stride(number)) for name in ("r1", "r2")]
        if number == WALKED // 2:
            heard.append((key("fix"), encode(POISON)))
    return heard


def serve(folder: Path, settings: IncidentSettings) -> None:
    """Serve until all is handled; print how it went."""
    network, stop, clock = MemoryNetwork(), Event(), ManualClock(NOW_NS)
    with (
        network.connect() as bus,
        network.connect() as other,
        Recorder(folder / "a.mcap", settings.as_metadata(), resume=True) as recorder,
    ):
        resumption = Resumption(folder / "a.mcap", recorder, settings)
        post = Post(
            bus, resumption.begin(), recorder, clock,
            follows_exercise=False, show=lambda _: None, checkpoints=resumption.checkpoints,
        )  # fmt: skip
        tracks = list[Received]()
        other.subscribe(key("track", "post", "p"), tracks.append)
        with resumption.watched():
            taken = resumption.take_up(post.take_up)
            thread = Thread(target=post.serve, args=(stop,))
            thread.start()
            before = recorder.taken
            # What was not on the disk comes again, as from a journal.
            for key_text, payload in said():
                other.publish(key_text, payload)
            wait_for(lambda: recorder.taken >= before + len(said()), "all to be heard")
            clock.set_ns(NOW_NS + 30 * NS_PER_S)
            wait_for(lambda: walked_to_the_end(tracks), "both to have walked on")
            stop.set()
            thread.join()
    print(taken and taken.begun_from, *(taken.put_aside if taken else ()))  # noqa: T201


def walked_to_the_end(tracks: list[Received]) -> bool:
    """Whether both were told of at their last stride."""
    last = [estimate_in(each) for each in list(tracks)]
    end_ns = START_NS + WALKED * NS_PER_S
    return {each.responder_id for each in last if each.event_time_ns == end_ns} == {"r1", "r2"}


if __name__ == "__main__":
    give = HandingOver.give
    HandingOver.give = lambda *given: poisoned(sys.argv[2], give, *given)  # type: ignore[method-assign]
    prepare_fusion(SETTINGS.fusion)
    stuck(np.ones(1, np.int64))
    if sys.argv[2] == "hang":
        watcher.MOST_TICKS, watcher.TOLD_TICKS, watcher.TICK_S = 8, 2, 0.5
    serve(Path(sys.argv[1]), SETTINGS)
