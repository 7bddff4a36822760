"""What an incident's programs are put through, short in the tests and long by command.

``python -m tests.faults ORDEAL`` runs one as long as it takes in the field, and prints what was
lost, what came twice, and how late live messages were meanwhile.
"""

from __future__ import annotations

import random
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from shared.codec import Refusal, parse_key
from shared.mcap_reader import read_recording
from shared.units import NS_PER_S
from tests.faults.air import Air, Channel, Link
from tests.faults.fleet import Deployment, Fleet, Program, account, is_safe, rows_of
from tests.waiting import let_last, wait_for

Floats: TypeAlias = NDArray[np.float64]

PATIENCE_S = 240.0
"""For what takes its time on a busy machine: starting Python several times, say."""

STAYS = "stays"
"""A responder within reach: a DAP of a simulated exercise stays for as long as there is one."""

UNHEARD_S = 4.0
"""For how long a DAP is silent: longer than any lease."""

SHORT = Link(delay_s=0.005)

SETTLED_NS = 5 * NS_PER_S
"""After this long a node has found another way: until then nothing of it is live."""


class Outcome(NamedTuple):
    """How it went. ``live_s`` are the median and the 99th percentile of how late beats were.

    A beat is never kept and says when it was sent; those sent after the fault count.
    ``silent_s`` is the longest time between two of a responder that came.
    """

    journalled: int
    lost: int
    repeated: int
    live_s: tuple[float, float] | None
    silent_s: float | None


def kills(
    folder: Path,
    times: int,
    seed: int = 1,
    lives_s: float = 3.0,
    daps: Sequence[str] = ("dap1", "dap2"),
) -> Outcome:
    """Kill agent, DAP and post, in turn and together, ``times`` times."""
    site = Deployment(folder, daps, ["r1", "r2"])
    programs = programs_of(site)
    chance = random.Random(seed)  # noqa: S311
    everybody = [program.name for program in programs]
    with Fleet(folder / "logs", programs) as fleet:
        fleet.start()
        has_said(site, 3)
        for number in range(times):
            together = number % len(everybody) == len(everybody) - 1
            victims = everybody if together else [everybody[number % len(everybody)]]
            fleet.kill(*victims)
            fleet.start(*victims)
            if number % len(everybody) == 0:
                has_said(site, 2)
            else:
                let_last(chance.uniform(0.2, 2.0) * lives_s)
        return ended(site, fleet)


def out_of_range(folder: Path, away_s: float) -> Outcome:
    """Let a responder walk out of range of one DAP, and back into that of another."""
    with Air(["post", "dap1", "dap2", "r1", STAYS]) as air:
        names = ["r1", STAYS]
        site = Deployment(folder, ["dap1", "dap2"], names, air, walk_s=2.0 * away_s + 120.0)
        programs = programs_of(site)
        for one, other in (("dap1", "post"), ("dap2", "post"), ("r1", "dap1"), (STAYS, "dap1")):
            air.link(one, other, Link(delay_s=0.005))
        with Fleet(folder / "logs", programs, air) as fleet:
            fleet.start()
            has_said(site, 3)
            wait_for(lambda: is_safe(site.journal("r1")), "a receipt", PATIENCE_S)
            air.cut("r1", "dap1")
            let_last(away_s)
            has_said(site, 3)
            air.link("r1", "dap2", Link(delay_s=0.005))
            back_ns = time.time_ns()
            has_said(site, 10)
            return ended(site, fleet, since_ns=back_ns + SETTLED_NS)


def multi_hop(folder: Path, lasts_s: float) -> Outcome:
    """Let DAPs stand in a row that breaks, and another way round be found."""
    with _row(folder) as (site, fleet, _):
        fleet.kill("dap1")
        killed_ns = time.time_ns()
        let_last(lasts_s)
        has_said(site, 10)
        return ended(site, fleet, since_ns=killed_ns + SETTLED_NS, without=["dap1"])


def multi_hop_silent(folder: Path, times: int, seed: int = 1) -> Outcome:
    """Let now one DAP of two between a third and the post fall silent, now the other."""
    with _row(folder) as (site, fleet, air):
        for silent in _in_turn(["dap1", "dap3"], times, seed):
            for other in ("post", "dap2"):
                air.cut(silent, other)
            let_last(UNHEARD_S)
            for other in ("post", "dap2"):
                air.link(silent, other, SHORT)
            wait_for(lambda: is_safe(site.journal(silent)), f"{silent} to be back", PATIENCE_S)  # noqa: B023
        return ended(site, fleet, since_ns=0)


@contextmanager
def _row(folder: Path) -> Iterator[tuple[Deployment, Fleet, Air]]:
    """Two ways from ``dap2``, which ``r1`` dials, to the post."""
    with Air(["post", "dap1", "dap2", "dap3", "r1"]) as air:
        site = Deployment(folder, ["dap1", "dap2", "dap3"], ["r1"], air)
        for one, other in (("dap1", "post"), ("dap2", "dap1"), ("dap2", "dap3"),
                           ("dap3", "post"), ("r1", "dap2")):  # fmt: skip
            air.link(one, other, SHORT)
        programs = [
            site.post(), site.dap("dap1", "post"), site.dap("dap3", "post"),
            site.dap("dap2", "dap1", "dap3"), site.agent("r1", "dap2"),
        ]  # fmt: skip
        with Fleet(folder / "logs", programs, air) as fleet:
            fleet.start()
            has_said(site, 3)
            yield site, fleet, air


def half_open(folder: Path, times: int, delay_s: float = 0.005, seed: int = 1) -> Outcome:
    """Take the DAP that an agent is linked to out of reach, with nothing said, and let it live.

    It is now the first and now the second that the agent dials. Its links take ``delay_s`` each
    way.
    """
    with Air(["post", "dap1", "dap2", "r1"]) as air:
        site = Deployment(folder, ["dap1", "dap2"], ["r1"], air)
        for dap in site.daps:
            air.link(dap, "post", SHORT)
            air.link("r1", dap, Link(delay_s=delay_s))
        with Fleet(folder / "logs", programs_of(site), air) as fleet:
            fleet.start()
            has_said(site, 3)
            wait_for(lambda: is_safe(site.journal("r1")), "a receipt", PATIENCE_S)
            for silent in _in_turn(site.daps, times, seed):
                air.cut("r1", silent)
                let_last(UNHEARD_S)
                air.link("r1", silent, Link(delay_s=delay_s))
            return ended(site, fleet, since_ns=0)


def _in_turn(names: Sequence[str], times: int, seed: int) -> Iterator[str]:
    """Give one name after the other, each after some time in which all is well."""
    chance = random.Random(seed)  # noqa: S311
    for number in range(times):
        let_last(chance.uniform(7.0, 8.0))
        yield names[number % len(names)]


def bad_air(
    folder: Path, responders: int, link: Link, cut_s: float, after_s: float, more: int = 10
) -> Outcome:
    """Let responders share ``link`` to one DAP, cut it for a while, and go on behind it.

    They go on for ``after_s``, and then for so many strides ``more``.
    """
    names = [f"r{number}" for number in range(1, responders + 1)]
    with Air(["post", "dap1", *names, STAYS]) as air:
        everybody = [*names, STAYS]
        site = Deployment(folder, ["dap1"], everybody, air, walk_s=2.0 * cut_s + after_s + 240.0)
        air.link("dap1", "post", Link(delay_s=0.005))
        air.link(STAYS, "dap1", Link(delay_s=0.005))
        for name in names:
            air.link(name, "dap1", link)
        with Fleet(folder / "logs", programs_of(site), air) as fleet:
            fleet.start()
            has_said(site, 3)
            for name in names:
                air.cut(name, "dap1")
            let_last(cut_s)
            has_said(site, 3)
            for name in names:
                air.link(name, "dap1", link)
            mended_ns = time.time_ns()
            let_last(after_s)
            has_said(site, more)
            return ended(site, fleet, since_ns=mended_ns + SETTLED_NS)


def lossy(folder: Path, responders: int = 2, loss: float = 0.2, cut_s: float = 30.0) -> Outcome:
    """Lose a share of all packets, and the link itself for a while."""
    link = Link(delay_s=0.01, loss=loss)
    return bad_air(folder, responders, link, cut_s, after_s=30.0)


def flapping(folder: Path, delay_s: float, times: int, seed: int = 1) -> Outcome:
    """Let a link come and go, with packets that take ``delay_s`` each way while it is there."""
    chance = random.Random(seed)  # noqa: S311
    link = Link(delay_s=delay_s)
    with Air(["post", "dap1", "r1", STAYS]) as air:
        site = Deployment(folder, ["dap1"], ["r1", STAYS], air)
        air.link("dap1", "post", SHORT)
        air.link(STAYS, "dap1", SHORT)
        air.link("r1", "dap1", link)
        with Fleet(folder / "logs", programs_of(site), air) as fleet:
            fleet.start()
            has_said(site, 3)
            for _ in range(times):
                air.cut("r1", "dap1")
                let_last(chance.uniform(0.3, 4.0))
                air.link("r1", "dap1", link)
                let_last(chance.uniform(0.3, 4.0))
            mended_ns = time.time_ns()
            has_said(site, 10)
            return ended(site, fleet, since_ns=mended_ns + SETTLED_NS)


def narrow(folder: Path, responders: int = 8, cut_s: float = 30.0) -> Outcome:
    """Let agents share 512 kbit/s, and make up for a cut on it."""
    link = Link(delay_s=0.01, channel=Channel(bit_per_s=512_000.0))
    return bad_air(folder, responders, link, cut_s, after_s=30.0)


def has_said(site: Deployment, more: int) -> None:
    """Wait until each responder has said so much more."""
    before = _said(site)

    def all_have() -> bool:
        return all(now >= then + more for now, then in zip(_said(site), before, strict=True))

    wait_for(all_have, "the agents to say something", PATIENCE_S)


def _said(site: Deployment) -> list[int]:
    journals = [site.journal(name) for name in site.responders]
    return [len(rows_of(path)) if path.exists() else 0 for path in journals]


def ended(
    site: Deployment, fleet: Fleet, *, since_ns: int | None = None, without: Sequence[str] = ()
) -> Outcome:
    """Wait until all is safe at the post, stop everybody, and hold journals against recording."""
    journals = [site.journal(name) for name in (*site.daps, *site.responders)
                if name not in without]  # fmt: skip
    wait_for(lambda: all(map(is_safe, journals)), "all to be safe at the post", 10 * PATIENCE_S)
    assert fleet.ended() == [], "some ended of themselves"
    codes = fleet.stop()
    assert set(codes.values()) == {0}, codes
    told = account(site.recording, journals)
    if since_ns is None:
        return Outcome(*told, None, None)
    beats = _beats_s(site.recording)
    late_s = np.concatenate([came - sent for sent, came in beats.values()])
    sent_s = np.concatenate([sent for sent, _ in beats.values()])
    late_s = late_s[sent_s >= since_ns / NS_PER_S]
    silent_s = max(float(np.diff(np.sort(came)).max()) for _, came in beats.values())
    return Outcome(*told, (float(np.median(late_s)), float(np.quantile(late_s, 0.99))), silent_s)


def _beats_s(recording: Path) -> dict[str, tuple[Floats, Floats]]:
    """Return when each responder's beats were sent and came (n,), by one machine's clock."""
    found: dict[str, list[tuple[int, int]]] = {}
    for message in read_recording(recording):
        key = parse_key(message.key)
        if not isinstance(key, Refusal) and (key.topic, key.role) == ("beat", "responder"):
            times_ns = (message.publish_time_ns, message.log_time_ns)
            found.setdefault(key.node_id, []).append(times_ns)
    columns = {name: np.array(times_ns).T / NS_PER_S for name, times_ns in found.items()}
    return {name: (sent_s, came_s) for name, (sent_s, came_s) in columns.items()}


def programs_of(site: Deployment) -> list[Program]:
    """Return everybody of a deployment whose agents dial every DAP, and DAPs the post."""
    return [
        site.post(),
        *(site.dap(name, "post") for name in site.daps),
        *(site.agent(name, *site.daps) for name in site.responders),
    ]
