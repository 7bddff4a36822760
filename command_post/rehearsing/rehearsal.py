"""Rehearsal: a scenario run offline, as fast as the machine goes, with the same parts and handlers.

The nodes' programs write what they would have published as wire logs; the logs are merged in the
order of publishing and handed to the incident and the recorder as if they had been heard. No
network and no clock takes part, so the same seed gives the same recording to the bit.
"""

from __future__ import annotations

import heapq
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Literal, NamedTuple, TypeAlias

from command_post.children import Children
from command_post.evaluation.evidence import Evidence, Track, vector_m
from command_post.incident import Incident, IncidentSettings
from command_post.recorder.file import RecordingFile
from command_post.recorder.recording import RecordedIncident
from shared.bus.wire_log import WireFrame, read_wire_log
from shared.simulation.odometry_errors import OdometrySource
from shared.units import NS_PER_S

STOP_GRACE_S = 1.0
"""What a node's program in rehearsal was about to write is of no use to anybody."""


class RehearsalError(RuntimeError):
    """A node's program failed in rehearsal; the text is what it said."""


class Fused(NamedTuple):
    """What came of one seed, and how long each of its messages took to handle (ms).

    ``told_s`` has when something was first told of a node, by what and of whom, since the first
    message.
    """

    evidence: Evidence
    handled_ms: list[float]
    told_s: dict[tuple[str, str], float]


BootMethod: TypeAlias = Literal["eskf", "linear"]
"""How simulated agents can read their boots."""


class Agents(NamedTuple):
    """What the agents of an exercise are told.

    ``method`` is how they read their boots, ``None`` for the agents' own default; ``raw`` whether
    they, and the DAPs, publish the samples and readings that nothing is fused from. ``odometry`` is
    whether boots are simulated, or the errors of strides alone; ``None`` as the scenario says.
    """

    method: BootMethod | None
    raw: bool
    odometry: OdometrySource | None = None

    def options(self) -> tuple[str, ...]:
        """Return it as ``edge-agent``'s arguments."""
        method = () if self.method is None else ("--method", self.method)
        odometry = () if self.odometry is None else ("--odometry", self.odometry)
        return (*method, *odometry, "--imu" if self.raw else "--no-imu")

    def dap_options(self) -> tuple[str, ...]:
        """Return it as ``dap-node``'s arguments."""
        return ("--rssi" if self.raw else "--no-rssi",)


def rehearse_nodes(scenario_name: str, seeds: range, directory: Path, agents: Agents) -> None:
    """Let agents and DAPs write their wire logs for ``seeds``: ``{seed}/{node}.wire``.

    Raises ``RehearsalError`` when one of the programs fails.
    """
    which = f"{seeds[0]}-{seeds[-1]}"
    for module, options in (("edge_agent", agents.options()), ("dap_node", agents.dap_options())):
        arguments = ("rehearse", scenario_name, "--seeds", which, "--output", str(directory))
        with Children(directory, STOP_GRACE_S) as children:
            children.start(module, module, (*arguments, "--with-parent", *options))
            if children.wait(module) != 0:
                said = children.log(module).read_text(errors="replace").strip()
                raise RehearsalError(f"{module} rehearse failed: {said}")


def merged_wire_logs(directory: Path) -> Iterator[WireFrame]:
    """Yield the frames of all logs in ``directory`` by time; at one time, by key."""
    logs = [read_wire_log(path) for path in sorted(directory.glob("*.wire"))]
    return heapq.merge(*logs, key=lambda frame: (frame.time_ns, frame.key))


def rehearse(
    scenario_name: str,
    seed: int,
    settings: IncidentSettings,
    path: Path,
    agents: Agents,
    *,
    replace: bool,
) -> None:
    """Run ``scenario_name`` offline and record it, estimates included, at ``path``.

    Raises ``RehearsalError``, and ``RecorderError`` where ``path`` cannot be written.
    """
    with tempfile.TemporaryDirectory(prefix="clew-rehearsal-") as folder:
        rehearse_nodes(scenario_name, range(seed, seed + 1), Path(folder), agents)
        file = RecordingFile(path, settings.as_metadata(), replace=replace)
        try:
            incident = RecordedIncident(Incident(settings), file)
            now_ns = 0
            for now_ns, key, payload in merged_wire_logs(Path(folder) / str(seed)):
                incident.handle(key, payload, now_ns)
            incident.finish(now_ns)
            file.finish()
        except BaseException:
            file.discard()
            raise


def fuse_logs(directory: Path, settings: IncidentSettings) -> Fused:
    """Fuse the wire logs of one seed and return what is needed to score them."""
    incident = Incident(settings)
    evidence = Evidence()
    handled_ms = []
    told_s: dict[tuple[str, str], float] = {}
    first_ns, now_ns = None, 0
    for now_ns, key, payload in merged_wire_logs(directory):
        first_ns = now_ns if first_ns is None else first_ns
        evidence.add_wire(key, payload)
        begun_s = time.perf_counter()
        told = incident.handle(key, payload, now_ns)
        handled_ms.append(1e3 * (time.perf_counter() - begun_s))
        for outgoing in told:
            evidence.add_wire(outgoing.key, outgoing.payload)
        for notice in incident.take_notices():
            told_s.setdefault((notice.reason, notice.node_id), (now_ns - first_ns) / NS_PER_S)
    for outgoing in incident.finish(now_ns):
        evidence.add_wire(outgoing.key, outgoing.payload)
    add_afterwards(evidence, incident)
    return Fused(evidence, handled_ms, told_s)


def add_afterwards(evidence: Evidence, incident: Incident) -> None:
    """Let the evidence have what the incident comes to with all that is known, if it can say."""
    after = incident.afterwards()
    if after is not None:
        evidence.add_afterwards(
            {name: Track(*track) for name, track in after.tracks.items()},
            {dap_id: vector_m(dap.position) for dap_id, dap in after.daps.items()},
        )
