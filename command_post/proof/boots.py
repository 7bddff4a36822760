"""Real boots and belts: recordings read by the agent, past DAPs simulated along the true way."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple, TypeAlias

import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray

from command_post.children import Children
from command_post.proof.trial import RESPONDER, Heard, Trial, peaks_told, stands_at
from command_post.rehearsing.rehearsal import STOP_GRACE_S, RehearsalError
from shared.bus.wire_log import read_wire_log
from shared.codec import message_of
from shared.exercise import REHEARSAL_START_NS
from shared.maths.angles import wrap_rad
from shared.messages import LocalPosition, Mount, OdometryIncrement, TrackStart, Truth
from shared.rssi_peaks import PeakSettings
from shared.simulation.chance import generator
from shared.simulation.plan import Floor, Plan
from shared.simulation.propagation import (
    RadioParameters,
    draw_surroundings,
    probability_heard,
    received_power_dbm,
)
from shared.units import NS_PER_S

Floats: TypeAlias = NDArray[np.float64]

DAP_ASIDE_M = 0.7
"""A DAP stands up to this far beside the way."""

START_SD_M = 0.3
PAUSE_S = 8.0
OUTDOORS = Plan("nothing but a floor", (Floor("ground", 0.0),))


class BootLog(NamedTuple):
    """What a recording's agent said, and the true stances: times (k,), north and east (k, 2)."""

    name: str
    said: list[TrackStart | OdometryIncrement]
    time_s: Floats
    truth_m: Floats


def retrace(
    paths: list[str], mount: Mount, method: str | None, folder: Path, *, equal_steps: bool = False
) -> list[BootLog]:
    """Let the agent read the recordings of a ``mount`` at ``paths``. Raises ``RehearsalError``."""
    options = ["--mount", mount] + ["--equal-steps"] * equal_steps
    options += [] if method is None else ["--method", method]
    with Children(folder, STOP_GRACE_S) as children:
        arguments = ("retrace", *paths, "--output", str(folder), "--with-parent", *options)
        children.start("edge_agent", "edge_agent", arguments)
        if children.wait("edge_agent") != 0:
            said = children.log("edge_agent").read_text(errors="replace").strip()
            raise RehearsalError(f"edge-agent retrace failed: {said}")
    return [_read(path) for path in sorted(folder.glob("*.wire"))]


def boot_trial(log: BootLog, spacing_m: float, heading_sd_deg: float, seed: int) -> Trial:
    """Return the trial of one recording, with a DAP for every ``spacing_m`` of its true way.

    The incident's frame lies as chance has it. Of their own frame's turn against it the agent
    knows as much as ``heading_sd_deg`` says, 180 being nothing, and chance draws the error.
    """
    chance = generator(seed, "proof of boots", log.name)
    known_sd_rad = math.radians(heading_sd_deg)
    turn_rad = (
        chance.uniform(-math.pi, math.pi)
        if heading_sd_deg >= 180.0
        else known_sd_rad * chance.normal()
    )
    truth_m = _turned(log.truth_m - log.truth_m[0], turn_rad - _frame_turn_rad(log))
    off_m = START_SD_M * chance.normal(size=2)
    start = LocalPosition(
        north_m=float(off_m[0]),
        east_m=float(off_m[1]),
        down_m=0.0,
        covariance_m2=(START_SD_M**2, 0.0, START_SD_M**2),
    )
    heard = [
        Heard(
            message.event_time_ns,
            "responder",
            RESPONDER,
            replace(message, position=start, heading_sd_rad=known_sd_rad)
            if isinstance(message, TrackStart)
            else message,
        )
        for message in log.said
    ]
    exercise_s = log.time_s - REHEARSAL_START_NS / NS_PER_S
    heard += _daps(exercise_s, truth_m, spacing_m, chance)
    return Trial(log.name, heard, log.time_s, truth_m)


def _read(path: Path) -> BootLog:
    said: list[TrackStart | OdometryIncrement] = []
    truth: list[tuple[float, float, float]] = []
    for _, key_text, payload in read_wire_log(path):
        message = message_of(key_text, payload)
        if isinstance(message, Truth):
            truth.append((message.event_time_ns / NS_PER_S, message.north_m, message.east_m))
        elif isinstance(message, (TrackStart, OdometryIncrement)):
            said.append(message)
    rows = np.array(truth)
    return BootLog(path.stem, said, rows[:, 0], rows[:, 1:])


def _frame_turn_rad(log: BootLog) -> float:
    """Return how the truth's frame is turned against the agent's, by the first half of the way.

    Only the agent's first heading is meant, and it drifts.
    """
    moves = [each for each in log.said if isinstance(each, OdometryIncrement)]
    time_s = np.array([each.event_time_ns / NS_PER_S for each in moves])
    way_m = np.cumsum([(each.d_north_m, each.d_east_m) for each in moves], axis=0)
    half = max(2, len(log.time_s) // 2)
    own_m = np.column_stack([np.interp(log.time_s[:half], time_s, axis) for axis in way_m.T])
    own = (own_m - own_m.mean(axis=0)) @ np.array([1.0, 1.0j])
    true_m = log.truth_m[:half]
    true = (true_m - true_m.mean(axis=0)) @ np.array([1.0, 1.0j])
    # What turns the agent's way onto the truth: the least-squares rotation (Umeyama 1991).
    total = complex(np.vdot(own, true))
    return wrap_rad(math.atan2(total.imag, total.real))


def _turned(vectors_m: Floats, turn_rad: float) -> Floats:
    cosine, sine = math.cos(turn_rad), math.sin(turn_rad)
    return np.asarray(vectors_m @ np.array([[cosine, sine], [-sine, cosine]]))


def _daps(
    time_s: Floats, truth_m: Floats, spacing_m: float, chance: np.random.Generator
) -> Iterator[Heard]:
    """Yield what DAPs say of a way (k,), (k, 2): each in the middle of its share of it."""
    length_m = np.append(0.0, np.cumsum(np.hypot(*np.diff(truth_m, axis=0).T)))
    count = max(1, math.ceil(length_m[-1] / spacing_m))
    worn_db = chance.normal()
    for number in range(count):
        at_m = (number + 0.5) * length_m[-1] / count
        place_m = np.array([np.interp(at_m, length_m, axis) for axis in truth_m.T])
        place_m += chance.uniform(-DAP_ASIDE_M, DAP_ASIDE_M, 2)
        dap_id = f"dap{number + 1}"
        yield stands_at(place_m, dap_id)
        heard_s, rssi_dbm = _readings(time_s, truth_m, place_m, worn_db, chance)
        yield from peaks_told(dap_id, heard_s, rssi_dbm, time_s[-1] + PAUSE_S, PeakSettings())


def _readings(
    time_s: Floats, truth_m: Floats, place_m: Floats, worn_db: float, chance: np.random.Generator
) -> tuple[Floats, Floats]:
    """Return times and values (dBm) of the readings of a DAP.

    The responder walked evenly from stance to stance, and stood after the last.
    """
    radio = RadioParameters()
    period_s = 1.0 / radio.scan_rate_hz
    scan_s = np.arange(time_s[0], time_s[-1] + PAUSE_S, period_s)
    scan_s += period_s * chance.uniform(-0.1, 0.1, len(scan_s))
    body_m = np.column_stack([np.interp(scan_s, time_s, axis) for axis in truth_m.T])
    ahead_m = np.column_stack([np.interp(scan_s + 1.0, time_s, axis) for axis in truth_m.T])
    heading_rad = np.arctan2(*(ahead_m - body_m).T[::-1])
    power_dbm = received_power_dbm(
        radio,
        OUTDOORS,
        draw_surroundings(radio, chance),
        np.append(place_m, 0.0),
        np.column_stack([body_m, np.zeros(len(body_m))]),
        heading_rad,
    )
    power_dbm += radio.responder_offset_sd_db * worn_db
    power_dbm += radio.dap_offset_sd_db * chance.normal()
    power_dbm += radio.noise_sd_db * chance.normal(size=len(power_dbm))
    rssi_dbm = np.round(power_dbm)
    heard = chance.random(len(rssi_dbm)) < probability_heard(radio, rssi_dbm)
    return scan_s[heard], rssi_dbm[heard]
