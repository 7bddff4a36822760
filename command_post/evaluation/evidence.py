"""What there is to score a run by: messages of a recording, sorted into tracks (pure)."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import Literal, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from shared.codec import Refusal, decode, parse_key
from shared.messages import (
    DapEstimate,
    DapInstallation,
    LocalPosition,
    Message,
    OdometryIncrement,
    Outline,
    TrackEstimate,
    TrackStart,
    Truth,
)
from shared.topics import Key
from shared.units import NS_PER_S

Floats: TypeAlias = NDArray[np.float64]
Ints: TypeAlias = NDArray[np.int64]

REST_S = 1.0
"""Who moves on so long after they were last told of has stood until then."""

Method: TypeAlias = Literal["pdr", "live", "after"]
_Mark: TypeAlias = tuple[int, int]
"""Event time and number of a message, which tell it from the others of its sender and kind."""


class Track(NamedTuple):
    """Places in the order of time: ``time_s`` (n ≥ 1,), ``position_m`` (n, 3: north, east, down).

    ``covariance_m2`` (n, 3: nn, ne, ee) where there is one; ``regions_m``, by index of the place,
    the outlines that tell more than it does.
    """

    time_s: Floats
    position_m: Floats
    covariance_m2: Floats | None = None
    regions_m: Mapping[int, tuple[Outline, ...]] = MappingProxyType({})

    def at(self, time_s: Floats) -> Track:
        """Return the track at other times (m,): straight lines between, at rest beyond the ends.

        Regions are not carried over.
        """
        covariance_m2 = self.covariance_m2
        return Track(
            time_s,
            _columns_at(time_s, self.time_s, self.position_m),
            None if covariance_m2 is None else _columns_at(time_s, self.time_s, covariance_m2),
        )

    def resting(self, places: Ints, until_s: Floats) -> Track:
        """Return the track with some of its places (k,), ascending, held ``until_s`` (k,)."""
        each = np.sort(np.concatenate([np.arange(self.time_s.size), places]))
        time_s = np.insert(self.time_s, places + 1, until_s)
        covariance_m2 = None if self.covariance_m2 is None else self.covariance_m2[each]
        regions_m = {
            k: self.regions_m[place]
            for k, place in enumerate(each.tolist())
            if place in self.regions_m
        }
        return Track(time_s, self.position_m[each], covariance_m2, regions_m)


class Evidence:
    """Collects messages, in any order and any number of times each, and makes tracks of them."""

    def __init__(self) -> None:
        self._starts: defaultdict[str, dict[_Mark, TrackStart]] = defaultdict(dict)
        self._increments: defaultdict[str, dict[_Mark, OdometryIncrement]] = defaultdict(dict)
        self._estimates: defaultdict[str, dict[_Mark, TrackEstimate]] = defaultdict(dict)
        self._responder_truth: defaultdict[str, dict[_Mark, Truth]] = defaultdict(dict)
        self._dap_truth: defaultdict[str, dict[_Mark, Truth]] = defaultdict(dict)
        self._dap_estimates: defaultdict[str, dict[_Mark, DapEstimate]] = defaultdict(dict)
        self._installations: defaultdict[str, dict[_Mark, DapInstallation]] = defaultdict(dict)
        self._smoothed: dict[str, Track] | None = None
        self._smoothed_daps_m: dict[str, Floats] = {}

    def add(self, key: Key, message: Message) -> None:
        """Take in a message that was heard or published under ``key``; others are passed over."""
        mark = (message.event_time_ns, message.sequence)
        match message:
            case TrackStart():
                self._starts[key.node_id][mark] = message
            case OdometryIncrement():
                self._increments[key.node_id][mark] = message
            case TrackEstimate():
                self._estimates[message.responder_id][mark] = message
            case DapEstimate():
                self._dap_estimates[message.dap_id][mark] = message
            case DapInstallation():
                self._installations[key.node_id][mark] = message
            case Truth():
                truth = self._dap_truth if key.role == "dap" else self._responder_truth
                truth[key.node_id][mark] = message

    def add_wire(self, key_text: str, payload: bytes) -> None:
        """Take in bytes as they were on the wire; what is no message is passed over."""
        key = parse_key(key_text)
        if isinstance(key, Refusal):
            return
        message = decode(key, payload)
        if not isinstance(message, Refusal):
            self.add(key, message)

    def add_afterwards(self, tracks: Mapping[str, Track], daps_m: Mapping[str, Floats]) -> None:
        """Take in what is held of everybody's way, and of where DAPs stand (3,), afterwards."""
        self._smoothed = dict(sorted(tracks.items()))
        self._smoothed_daps_m = dict(daps_m)

    @property
    def is_smoothed(self) -> bool:
        """Whether there is anything that was made of it afterwards."""
        return self._smoothed is not None

    def tracks(self, method: Method) -> dict[str, Track]:
        """Return each responder's track by id, in the order of the ids.

        ``live`` is what the post said of each moment at last, ``after`` what it made of everything
        afterwards; ``pdr`` sums the increments up from the newest start before them, unturned. A
        responder without a start has no such track. Both are at rest until the responder moves on.
        """
        if method == "after":
            return self._smoothed or {}
        tracks = (
            {name: _live_track(said) for name, said in sorted(self._estimates.items())}
            if method == "live"
            else {name: self._dead_reckoning(name) for name in sorted(self._starts)}
        )
        return {name: self._with_rests(name, track) for name, track in tracks.items()}

    def responders(self) -> list[str]:
        """Return the ids of all responders of whom there is a track or a truth."""
        return sorted(self._starts.keys() | self._estimates.keys() | self._responder_truth.keys())

    def truth(self, responder_id: str) -> Track | None:
        """Return where a responder really was, if that is known."""
        said = self._responder_truth.get(responder_id)
        if not said:
            return None
        rows = {mark[0]: (t.north_m, t.east_m, t.down_m) for mark, t in sorted(said.items())}
        return Track(_seconds(rows), np.array(list(rows.values())))

    def dap_estimates_m(self) -> dict[str, Floats]:
        """Return where each DAP was held to stand at last (3,), by id."""
        newest = {name: said[max(said)].position for name, said in self._dap_estimates.items()}
        return {name: vector_m(newest[name]) for name in sorted(newest)}

    def dap_truths_m(self) -> dict[str, Floats]:
        """Return where each DAP really stood at last (3,), by id."""
        newest = {name: said[max(said)] for name, said in self._dap_truth.items()}
        return {name: vector_m(newest[name]) for name in sorted(newest)}

    def dap_errors_m(self, method: Method = "live") -> dict[str, float]:
        """Return the horizontal errors of the DAPs that somebody set down, by id.

        One at a known point, that nobody carried there, says nothing of the tracking; and by dead
        reckoning alone there are none.
        """
        truths = self.dap_truths_m()
        estimates = {"pdr": {}, "live": self.dap_estimates_m(), "after": self._smoothed_daps_m}
        return {
            name: float(np.hypot(*(place_m - truths[name])[:2]))
            for name, place_m in estimates[method].items()
            if name in truths and not self._stood_there(name)
        }

    def first_dap_m(self) -> Floats:
        """Return the true north and east (2,) of the DAP installed first, else of the origin."""
        truths = self.dap_truths_m()
        installed = [
            (min(said), name) for name, said in self._installations.items() if name in truths
        ]
        return truths[min(installed)[1]][:2] if installed else np.zeros(2)

    def _stood_there(self, dap_id: str) -> bool:
        said = self._installations.get(dap_id, {})
        return bool(said) and said[max(said)].installer_id is None

    def _dead_reckoning(self, responder_id: str) -> Track:
        starts = sorted(self._starts[responder_id].items())
        moves = sorted(self._increments.get(responder_id, {}).items())
        next_ns = [mark[0] for mark, _ in starts[1:]]
        rows: dict[int, Floats] = {}
        place_m = np.zeros(3)
        for (mark, start), end_ns in zip(starts, [*next_ns, math.inf], strict=True):
            if start.position is not None:
                place_m = vector_m(start.position)
            rows[mark[0]] = place_m
            for (time_ns, _), move in moves:
                if mark[0] < time_ns <= end_ns:
                    place_m = place_m + _step(move)
                    rows[time_ns] = place_m
        return Track(_seconds(rows), np.array(list(rows.values())))

    def _with_rests(self, responder_id: str, track: Track) -> Track:
        """Return a track of who stood until they moved on, not gone there all the while."""
        moves = sorted(self._increments.get(responder_id, {}).items())
        if not moves:
            return track
        ends_s = _seconds(mark[0] for mark, _ in moves)
        begins_s = _seconds(move.start_time_ns for _, move in moves)
        following = np.searchsorted(ends_s, track.time_s[:-1], side="right")
        rest_s = begins_s[np.minimum(following, len(moves) - 1)]
        rested = (rest_s - track.time_s[:-1] > REST_S) & (rest_s < track.time_s[1:])
        return track.resting(np.flatnonzero(rested), rest_s[rested])


def _live_track(said: dict[_Mark, TrackEstimate]) -> Track:
    newest = {mark[0]: estimate for mark, estimate in sorted(said.items())}
    covariance_m2 = np.array([estimate.covariance_m2 for estimate in newest.values()])
    place_m = np.array([vector_m(estimate) for estimate in newest.values()])
    regions_m = {
        k: estimate.regions_m for k, estimate in enumerate(newest.values()) if estimate.regions_m
    }
    return Track(_seconds(newest), place_m, covariance_m2, regions_m)


def vector_m(place: LocalPosition | Truth | TrackEstimate) -> Floats:
    """Return north, east, down (3,) of what says them."""
    return np.array([place.north_m, place.east_m, place.down_m])


def _step(move: OdometryIncrement) -> Floats:
    return np.array([move.d_north_m, move.d_east_m, move.d_down_m])


def _seconds(times_ns: Iterable[int]) -> Floats:
    return np.array([time_ns / NS_PER_S for time_ns in times_ns])


def _columns_at(time_s: Floats, known_s: Floats, columns: Floats) -> Floats:
    """Interpolate each column of (n, k) linearly, from times (n,) to (m,): (m, k)."""
    return np.stack([np.interp(time_s, known_s, column) for column in columns.T], axis=1)
