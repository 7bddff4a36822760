"""Two rules for nearness on the same recordings, at the same rate of false alarms (pure).

A rule's threshold trades passes missed for false alarms, so that two rules can only be compared
where they raise as many of these. The published rule's thresholds are given; the likelihood's is
the lowest at which neither false stays nor false seconds are more.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple, TypeAlias

import msgspec

from dap_node.detector_score import (
    DetectorScore,
    DetectorTrial,
    Link,
    evidence_of,
    score_detector,
    try_detector,
)
from dap_node.proximity import ProximitySettings

SHIFTS_DB = tuple(float(shift) for shift in range(-4, 11))
"""How far the published rule's thresholds are moved from where they are set."""

LOG_ODDS = tuple(step / 4.0 for step in range(-24, 17))
"""The likelihood's thresholds for entering that are tried."""

Trials: TypeAlias = list[DetectorTrial]
"""One for each link."""


class Point(NamedTuple):
    """A rule at one threshold: dBm of ``published``, log odds of ``likelihood``."""

    threshold: float
    score: DetectorScore


class Row(NamedTuple):
    """A point of the published rule, and the likelihood beside it.

    ``at_rate`` is the lowest threshold that raises no more false alarms, ``at_misses`` the highest
    one that misses no more passes; ``None`` where none does both.
    """

    published: Point
    at_rate: Point | None
    at_misses: Point | None


class Beside(NamedTuple):
    """One recording, or all ``together``: both rules at thresholds that are not of its making.

    Those of the likelihood are chosen as in ``Row``; those of all together differ.
    """

    recording: str
    published: DetectorScore
    at_rate: DetectorScore
    at_misses: DetectorScore


class Comparison(NamedTuple):
    """Both rules on some recordings.

    ``configured`` is where the published rule is set, ``rows`` are where it might be, and
    ``likelihood`` is where that is set. ``each`` goes through the recordings at ``configured``;
    ``left_out`` too, with the likelihood's thresholds chosen on the other recordings alone, and
    ends with all of them together. Where no threshold will do, it is the one that is set.
    """

    configured: Row
    likelihood: Point
    rows: list[Row]
    each: list[Beside]
    left_out: list[Beside]


def compare(links: Sequence[Link], settings: ProximitySettings, pass_m: float) -> Comparison:
    """Return how the likelihood does beside the published rule on ``links`` (n ≥ 1).

    Who comes within ``pass_m`` passes the receiver. Both rules are otherwise set as ``settings``.
    """
    evidence = [evidence_of(link, settings) for link in links]

    def trials(chosen: ProximitySettings) -> Trials:
        return [
            try_detector(heard, chosen, link.true_range, pass_m)
            for link, heard in zip(links, evidence, strict=True)
        ]

    return _Bench([link.recording for link in links], settings, trials).compare()


class _Bench:
    """Both rules tried at all thresholds, link by link; ``names`` are the links' recordings."""

    def __init__(
        self,
        names: Sequence[str],
        settings: ProximitySettings,
        trials: Callable[[ProximitySettings], Trials],
    ) -> None:
        self._names = names
        self._set_dbm = settings.enter_dbm
        self._set_log_odds = settings.range.enter_log_odds
        self._published = {
            settings.enter_dbm + shift_db: trials(_published(settings, shift_db))
            for shift_db in SHIFTS_DB
        }
        thresholds = sorted({*LOG_ODDS, self._set_log_odds})
        self._likelihood = {at: trials(_likelihood(settings, at)) for at in thresholds}

    def compare(self) -> Comparison:
        """Return the rows of both rules, as configured and at other thresholds."""
        everything = set(self._names)
        configured = self._row(self._set_dbm, everything)
        names = list(dict.fromkeys(self._names))
        return Comparison(
            configured,
            Point(
                self._set_log_odds, self._score(self._likelihood[self._set_log_odds], everything)
            ),
            [self._row(dbm, everything) for dbm in self._published if dbm != self._set_dbm],
            [_beside(name, self._held(configured, name)) for name in names],
            self._leave_out(names) if len(names) > 1 else [],
        )

    def _leave_out(self, names: list[str]) -> list[Beside]:
        """Choose on all recordings but one, try on that one, and sum up."""
        held = {
            name: self._held(self._row(self._set_dbm, {*names} - {name}), name) for name in names
        }
        pooled = [
            [trial for trials in rule for trial in trials]
            for rule in zip(*held.values(), strict=True)
        ]
        every = [_beside(name, trials) for name, trials in held.items()]
        return [*every, _beside("together", pooled)]

    def _held(self, row: Row, name: str) -> list[Trials]:
        """Return the trials of a recording: published, likelihood at its rate, at its misses."""
        chosen = [
            point or Point(self._set_log_odds, row.published.score)
            for point in (row.at_rate, row.at_misses)
        ]
        rules = [self._published[self._set_dbm]]
        rules += [self._likelihood[point.threshold] for point in chosen]
        return [self._of(trials, {name}) for trials in rules]

    def _row(self, dbm: float, which: set[str]) -> Row:
        """Set the likelihood beside the published rule at ``dbm``, on the recordings ``which``."""
        published = Point(dbm, self._score(self._published[dbm], which))
        allowed = published.score
        points = [Point(at, self._score(self._likelihood[at], which)) for at in self._likelihood]
        quiet = [
            point
            for point in points
            if point.score.false_stays_per_h <= allowed.false_stays_per_h
            and point.score.false_events_per_h <= allowed.false_events_per_h
        ]
        as_good = [point for point in quiet if point.score.missed <= allowed.missed]
        return Row(published, next(iter(quiet), None), next(reversed(as_good), None))

    def _score(self, trials: Trials, which: set[str]) -> DetectorScore:
        return score_detector(self._of(trials, which))

    def _of(self, trials: Trials, which: set[str]) -> Trials:
        return [trial for name, trial in zip(self._names, trials, strict=True) if name in which]


def _beside(name: str, rules: Sequence[Trials]) -> Beside:
    return Beside(name, *(score_detector(trials) for trials in rules))


def _published(settings: ProximitySettings, shift_db: float) -> ProximitySettings:
    return msgspec.structs.replace(
        settings,
        method="published",
        enter_dbm=settings.enter_dbm + shift_db,
        leave_dbm=settings.leave_dbm + shift_db,
    )


def _likelihood(settings: ProximitySettings, enter_log_odds: float) -> ProximitySettings:
    drop = settings.range.enter_log_odds - settings.range.leave_log_odds
    chosen = msgspec.structs.replace(
        settings.range, enter_log_odds=enter_log_odds, leave_log_odds=enter_log_odds - drop
    )
    return msgspec.structs.replace(settings, method="likelihood", range=chosen)
