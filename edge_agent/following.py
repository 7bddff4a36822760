"""How an agent follows a source: as the clock comes to its readings, alone or in an exercise."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict
from itertools import dropwhile
from threading import Event

import structlog

from edge_agent.agent import Agent
from edge_agent.mounts.interface import Faults
from edge_agent.sources.reading import Reading, Source
from shared.clock import Clock
from shared.exercise import await_exercise
from shared.gate import Gate
from shared.node import Node
from shared.process import wait_until
from shared.topics import finished_key

LINGER_POLL_S = 0.2
MOST_LINGER_S = 10.0
"""A post that is there and has not said in so long that all is safe will not say so."""

WAIT_AHEAD_NS = 10_000_000
"""Samples this close together are taken without a wait between them."""

TICK_NS = 500_000_000
"""While no sample comes, the agent is told this often how late it is."""

_log = structlog.stdlib.get_logger(__name__)


def play(node: Node, agent: Agent, source: Source, speed: float) -> None:
    """Follow ``source`` from now on, link or no link, and stay until a post has all of it."""
    begin_ns = node.clock.now_ns()
    node.clock.run_from(begin_ns, speed)
    if _follow(agent, source.beginning_at(begin_ns), node.clock, node.stop):
        _wait_until_safe(node)


def _wait_until_safe(node: Node) -> None:
    """Wait until a post has all that the journal holds safe; not for one that never says so."""
    waited_s = 0.0
    while waited_s < MOST_LINGER_S and not node.stop.wait(LINGER_POLL_S):
        if all(each.acknowledged == each.last_number for each in node.outbox.holdings()):
            return
        waited_s = waited_s + LINGER_POLL_S if node.bus.connected() else 0.0
    _log.warning("what no post has yet stays in the journal: the next start brings it there")


def take_part(node: Node, agent: Agent, source: Source) -> None:
    """Follow ``source`` from the start of the exercise, at its speed.

    Who comes later follows it from then on: what a sensor read before is gone. The wearer then
    stays where they are, until the exercise is over for everybody.
    """
    exercise = await_exercise(node.bus, node.incident, Gate(node.verifier), node.stop)
    if exercise is None:
        return
    begin_ns = exercise.event_time_ns
    node.clock.run_from(begin_ns, exercise.speed)
    readings = source.beginning_at(begin_ns)
    if begin_ns < node.came_ns:
        now_ns = node.clock.now_ns()
        readings = dropwhile(lambda reading: reading.time_ns < now_ns, readings)
        agent.forget_place()
    _follow(agent, readings, node.clock, node.stop)
    node.bus.declare_alive(finished_key(node.incident, node.node_id))
    node.stop.wait()


def tell_losses(agent: Agent, faults: Faults, unsent: int) -> None:
    """Say what was wrong with the samples, and what the post will miss, if anything."""
    counts = {name: count for name, count in asdict(faults).items() if count}
    if counts:
        _log.warning("samples were not as they should be", **counts)
    if agent.why_no_movement is not None:
        _log.warning("no movement was told", why=agent.why_no_movement)
    if unsent:
        _log.info("not heard live: there was no link", count=unsent)


def _follow(agent: Agent, readings: Iterator[Reading], clock: Clock, stop: Event) -> bool:
    """Hand ``readings`` to the agent as the clock comes to their times.

    Returns whether that was all of them, or ``stop`` was set before.
    """
    waited_ns = 0
    for reading in readings:
        if reading.time_ns >= waited_ns:
            while reading.time_ns - clock.now_ns() > TICK_NS:
                if not wait_until(clock, clock.now_ns() + TICK_NS, stop):
                    return False
                agent.pass_time(clock.now_ns())
            if not wait_until(clock, reading.time_ns, stop):
                return False
            waited_ns = reading.time_ns + WAIT_AHEAD_NS
        agent.take(reading)
    agent.finish()
    return True
