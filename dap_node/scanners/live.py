"""What a DAP's radios hear and its accelerometer feels, as one line of time."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from threading import Event

from dap_node.scanners.observation import Motion, Observation, SetDown
from shared.clock import Clock
from shared.radios.live import LiveSource, gathered
from shared.radios.readings import RadioScan

TICK_S = 0.25
"""So long after the last scan an empty one follows: a DAP knows no time but that of its scans."""


def live_observations(
    sources: Sequence[LiveSource[RadioScan | Motion]],
    clock: Clock,
    stop: Event,
    button: Event | None = None,
) -> Iterator[Observation]:
    """Yield what all ``sources`` hear, in the order of time, until ``stop`` is set.

    The DAP has been set down whenever ``button`` is set, which is cleared. Raises what a source
    raises that cannot go on.
    """
    last_ns = clock.now_ns()
    for heard in gathered(sources, clock.now_ns, stop, TICK_S):
        observation = RadioScan(clock.now_ns(), ()) if heard is None else heard
        # What two sources hear may come in crosswise.
        last_ns = max(last_ns, observation.time_ns)
        yield observation._replace(time_ns=last_ns)
        if button is not None and button.is_set():
            button.clear()
            yield SetDown(last_ns, None, None)
