"""A crowd for benchmarks: crews who walk a floor of their own, past DAPs that they set down.

It is no test of accuracy: ways are rectangles, and errors simpler than a boot's or a radio's.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from shared.messages import (
    DapInstallation,
    LocalPosition,
    Message,
    OdometryIncrement,
    RssiPeak,
    TrackStart,
)
from shared.units import NS_PER_S

Floats: TypeAlias = NDArray[np.float64]

START_NS = 1_700_000_000 * NS_PER_S
STRIDE_M = 1.2
DAP_EVERY_M = 20.0
PEAK_DBM = -41.0
JUMP_RAD, JUMP_SHARE = 0.1, 1.0 / 150.0
"""Now and then a heading jumps."""


class Said(NamedTuple):
    """Who says what."""

    node_id: str
    message: Message


def crowd(
    crews: int | Sequence[int], members: int, minutes: float, strides_a_second: float, seed: int,
    *, within_s: float = 100.0,
) -> Iterator[Said]:  # fmt: skip
    """Yield what crews of ``members`` say, in the order of time; each sets down 6 DAPs or more.

    Or several crews of sizes of their own. All of a crew begin ``within_s``, or every 2.5 s.
    """
    sizes = [members] * crews if isinstance(crews, int) else crews
    said = [
        each
        for crew, size in enumerate(sizes)
        for each in _crew(
            crew, size, minutes, strides_a_second, min(2.5, within_s / size),
            np.random.default_rng((seed, crew)),
        )
    ]  # fmt: skip
    yield from sorted(said, key=lambda each: each.message.event_time_ns)


def _crew(
    crew: int, members: int, minutes: float, rate_hz: float, every_s: float,
    chance: np.random.Generator,
) -> Iterator[Said]:  # fmt: skip
    place_m = np.array([100.0 * (crew % 16), 100.0 * (crew // 16)])
    daps = max(6, members // 2)
    round_m = DAP_EVERY_M * daps
    dap_m = DAP_EVERY_M * (np.arange(daps) + 0.5)
    for member in range(members):
        name = f"r{crew}-{member}"
        # Nobody keeps in step with others.
        begin_s = 1.0 + every_s * member + chance.uniform(0.0, 2.0)
        yield Said(name, _start(begin_s, place_m))
        count = int(60.0 * minutes * rate_hz)
        length_m = STRIDE_M * np.arange(count + 1, dtype=np.float64)
        way_m = _on_rectangle(length_m % round_m, round_m)
        jump_rad = chance.normal(0.0, JUMP_RAD, count) * (chance.random(count) < JUMP_SHARE)
        drift_rad = np.cumsum(chance.normal(0.0, 0.006, count) + jump_rad)
        turn_rad = chance.normal(0.0, 0.1) + drift_rad
        step_m = np.diff(way_m, axis=0)
        cosine, sine = np.cos(turn_rad), np.sin(turn_rad)
        own_m = np.column_stack([
            cosine * step_m[:, 0] - sine * step_m[:, 1], sine * step_m[:, 0] + cosine * step_m[:, 1]
        ]) + chance.normal(0.0, 0.03, (count, 2))  # fmt: skip
        end_s = begin_s + 1.0 + (1.0 + np.arange(count)) / rate_hz
        for k, (north_m, east_m) in enumerate(own_m.tolist()):
            yield Said(name, _stride(end_s[k], 1.0 / rate_hz, north_m, east_m, k))
        for dap, at_m in enumerate(dap_m.tolist()):
            passed_m = np.arange(at_m, length_m[-1], round_m)
            for number, passed_s in enumerate(np.interp(passed_m, length_m[1:], end_s).tolist()):
                first = member == 0 and number == 0
                if first:
                    yield Said(f"dap{crew}-{dap}", _installation(passed_s, name))
                else:
                    heard_s = passed_s + chance.normal(0.0, 0.2)
                    yield Said(f"dap{crew}-{dap}", _peak(heard_s, name, number))


def _on_rectangle(along_m: Floats, round_m: float) -> Floats:
    long_m, short_m = 0.3 * round_m, 0.2 * round_m
    corners = np.cumsum([0.0, long_m, short_m, long_m, short_m])
    return np.column_stack([
        np.interp(along_m, corners, [0.0, long_m, long_m, 0.0, 0.0]),
        np.interp(along_m, corners, [0.0, 0.0, short_m, short_m, 0.0]),
    ])  # fmt: skip


def _ns(time_s: float) -> int:
    return START_NS + round(time_s * NS_PER_S)


def _start(time_s: float, place_m: Floats) -> TrackStart:
    north_m, east_m = place_m.tolist()
    position = LocalPosition(
        north_m=north_m, east_m=east_m, down_m=0.0, covariance_m2=(0.1, 0.0, 0.1)
    )
    return TrackStart(
        event_time_ns=_ns(time_s), sequence=0, position=position, heading_sd_rad=0.5,
        mount="boot", method="strides",
    )  # fmt: skip


def _stride(
    end_s: float, took_s: float, north_m: float, east_m: float, sequence: int
) -> OdometryIncrement:
    return OdometryIncrement(
        event_time_ns=_ns(end_s), sequence=sequence, start_time_ns=_ns(end_s - 0.6 * took_s),
        d_north_m=north_m, d_east_m=east_m, d_down_m=0.0, d_heading_rad=0.0, heading_rad=0.0,
        covariance=(4e-4, 0.0, 0.0, 0.0, 4e-4, 0.0, 0.0, 4e-4, 0.0, 4e-5), mount="boot",
    )  # fmt: skip


def _installation(time_s: float, installer_id: str) -> DapInstallation:
    return DapInstallation(
        event_time_ns=_ns(time_s), sequence=0, installer_id=installer_id, position=None
    )


def _peak(time_s: float, responder_id: str, sequence: int) -> RssiPeak:
    return RssiPeak(
        event_time_ns=_ns(time_s), sequence=sequence, responder_id=responder_id,
        peak_dbm=PEAK_DBM, width_s=1.0, sample_count=5,
    )  # fmt: skip
