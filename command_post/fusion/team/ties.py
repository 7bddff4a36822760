"""What ties responders to places: DAPs set down and passed, and meetings (pure)."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Mapping
from typing import NamedTuple, TypeAlias

import numpy as np

from command_post.fusion.team.chain import Chain
from command_post.fusion.team.log import Peak, ResponderLog, TeamLog
from command_post.fusion.team.move_log import Floats, Ints
from command_post.fusion.team.settings import TeamSettings
from shared.compiled import compiled
from shared.messages import LocalPosition
from shared.units import NS_PER_S

PlaceId: TypeAlias = tuple[str, ...]
"""A DAP where it stood since a time, or a meeting of two responders."""

SAME_PASS_S = 5.0
LEAST_SD_M = 0.1


class Ties(NamedTuple):
    """Places reached by chains, t of them.

    ``chain``, ``time_ns`` and ``stance`` (t,) are by which chain, when, and at which stance,
    ``offset_m`` (t, 2) how far north and east from there; then deviations (m) and degrees of
    freedom (t,). ``share`` (t,) of a whole tie is what each says: its deviation is as much wider as
    is due to that.
    """

    chain: Ints
    time_ns: Ints
    stance: Ints
    offset_m: Floats
    place: list[PlaceId]
    sd_m: Floats
    dof: Floats
    share: Floats

    def ordered(self, order: Ints) -> Ties:
        """Return them in another order."""
        return Ties(
            self.chain[order], self.time_ns[order], self.stance[order], self.offset_m[order],
            [self.place[at] for at in order.tolist()],
            self.sd_m[order], self.dof[order], self.share[order],
        )  # fmt: skip


class Known(NamedTuple):
    """What is known of a place beforehand: where it is, and each way's standard deviation.

    Of one that was ``found`` by passes it is known where it is passed, and not where it stands.
    """

    north_m: float
    east_m: float
    sd_m: float
    found: bool = False


class _Standing(NamedTuple):
    """Since when a DAP stood somewhere, and what that place is called; ``None``: nowhere."""

    since_ns: list[int]
    place: list[PlaceId | None]


def ties_of(
    log: TeamLog, chains: list[Chain], until_ns: int, settings: TeamSettings
) -> tuple[Ties, dict[PlaceId, Known]]:
    """Return all ties, and what is known of places beforehand."""
    number = {chain.responder_id: index for index, chain in enumerate(chains)}
    stands: dict[str, _Standing] = {}
    known: dict[PlaceId, Known] = {}
    ties: list[Ties] = []
    for dap_id in sorted(log.daps):
        for installed in log.daps[dap_id]:
            if installed.time_ns > until_ns:
                break
            place = ("dap", dap_id, str(installed.time_ns))
            chain = number.get(installed.installer_id or "")
            if chain is not None:
                ties.append(_install_tie(chains, chain, installed.time_ns, place, settings))
            elif installed.position is not None:
                known[place] = _known(installed.position, found=installed.found)
            elif not installed.is_taken_up:
                continue
            standing = stands.setdefault(dap_id, _Standing([], []))
            standing.since_ns.append(installed.time_ns)
            standing.place.append(None if installed.is_taken_up else place)
    for index in range(len(chains)):
        ties.append(_pass_ties(log, chains, index, stands, until_ns, settings))
        ties += _meeting_ties(log, chains, index, number, until_ns, settings)
    return _joined(ties), known


def _joined(several: list[Ties]) -> Ties:
    columns = zip(*several, strict=True)
    places = [place for ties in several for place in ties.place]
    return Ties(*(
        places if name == "place" else np.concatenate(column)
        for name, column in zip(Ties._fields, columns, strict=True)
    ))  # type: ignore[arg-type]  # fmt: skip


def _install_tie(
    chains: list[Chain], chain: int, time_ns: int, place: PlaceId, settings: TeamSettings
) -> Ties:
    """Return the tie of a DAP to its installer, who set it down before them."""
    tie = _ties(chains, chain, [time_ns], [place], [settings.install_sd_m], 0.0)
    ahead = np.array(chains[chain].ahead(time_ns))
    return tie._replace(offset_m=tie.offset_m + settings.install_ahead_m * ahead)


def asides_m2(
    ties: Ties, known: Mapping[PlaceId, Known], settings: TeamSettings
) -> dict[PlaceId, float]:
    """Return, of each known place, the variance of how far aside of it all pass it (m²), each way.

    Walls, bodies and where there is a way put all passes of a DAP off alike: many say no more than
    a few of where its wearers are, and the blunter each one is, the less.
    """
    passes_m2: dict[PlaceId, list[float]] = {
        place: [] for place, each in known.items() if not each.found
    }
    if passes_m2:
        rows = zip(
            ties.place, ties.dof.tolist(), ties.share.tolist(), ties.sd_m.tolist(), strict=True
        )
        for place, dof, share, sd_m in rows:
            if dof and place in passes_m2:
                passes_m2[place].append(share * sd_m**2)
    blunt_m2 = settings.sharpness.sd_at_m(settings.sharpness.least_dbm) ** 2
    return {
        place: settings.aside_share**2 * (math.fsum(each) / len(each) if each else blunt_m2)
        for place, each in passes_m2.items()
    }


def _known(position: LocalPosition, *, found: bool) -> Known:
    return Known(position.north_m, position.east_m, level_sd_m(position), found)


def level_sd_m(position: LocalPosition) -> float:
    """Return how well a place is known, each way alike; what no covariance can be counts as 0."""
    nn, _, ee = position.covariance_m2
    return math.sqrt(max(0.5 * (nn + ee), LEAST_SD_M**2))


def _pass_ties(
    log: TeamLog, chains: list[Chain], index: int, stands: dict[str, _Standing],
    until_ns: int, settings: TeamSettings,
) -> Ties:  # fmt: skip
    """Return a responder's passes of DAPs, each tied to where the DAP then stood, if it did."""
    heard = log.responders[chains[index].responder_id]
    places: list[PlaceId] = []
    times_ns, sds_m = [], []
    for time_ns, dap_id, peak_dbm in _passes(heard, until_ns, settings):
        standing = stands.get(dap_id)
        at = bisect_right(standing.since_ns, time_ns) if standing else 0
        place = standing.place[at - 1] if standing and at else None
        if place is not None:
            times_ns.append(time_ns)
            places.append(place)
            sds_m.append(settings.sharpness.sd_at_m(peak_dbm))
    ties = _ties(chains, index, times_ns, places, sds_m, settings.sharpness.dof)
    return _shadowed_alike(ties, chains[index], settings.shadowing_m)


def _shadowed_alike(ties: Ties, chain: Chain, shadowing_m: float) -> Ties:
    """Return a chain's ties to what it heard, those to one within ``shadowing_m`` of way as one.

    The same walls and bodies shadow them: all of them together say no more than one does. They
    must be in the order of time.
    """
    number: dict[PlaceId, int] = {}
    of_what = [number.setdefault(place[:-1], len(number)) for place in ties.place]
    alike = _alike(chain.length_m[ties.stance], np.array(of_what, np.int64), shadowing_m)
    return ties._replace(sd_m=ties.sd_m * np.sqrt(alike), share=1.0 / alike)


@compiled
def _alike(way_m: Floats, of_what: Ints, shadowing_m: float) -> Floats:
    """Return how many of the same lie within ``shadowing_m`` of each, which counts itself."""
    alike = np.ones(way_m.size)
    for k in range(way_m.size):
        least_m, most_m = way_m[k] - shadowing_m, way_m[k] + shadowing_m
        other = k - 1
        while other >= 0 and way_m[other] >= least_m:
            if of_what[other] == of_what[k]:
                alike[k] += 1.0
            other -= 1
        other = k + 1
        while other < way_m.size and way_m[other] <= most_m:
            if of_what[other] == of_what[k]:
                alike[k] += 1.0
            other += 1
    return alike


def _meeting_ties(
    log: TeamLog, chains: list[Chain], index: int, number: dict[str, int],
    until_ns: int, settings: TeamSettings,
) -> list[Ties]:  # fmt: skip
    """Return both ties of each meeting that is logged with this responder."""
    responder_id = chains[index].responder_id
    places: list[PlaceId] = []
    times_ns, sds_m, others = [], [], []
    for meeting in _meetings(log.responders[responder_id].contacts, until_ns, settings):
        other = number.get(meeting.other_id)
        if other is None:
            continue
        times_ns.append(meeting.time_ns)
        places.append(("meeting", responder_id, meeting.other_id, str(meeting.time_ns)))
        sd_m = settings.sharpness.sd_at_m(meeting.peak_dbm + settings.contact_gain_db)
        # Either is half of the way from where they met.
        sds_m.append(settings.contact_share * max(sd_m, settings.contact_sd_least_m))
        others.append(other)
    if not others:
        return []
    dof = settings.sharpness.dof
    own = _ties(chains, index, times_ns, places, sds_m, dof)
    own = _shadowed_alike(own, chains[index], settings.shadowing_m)
    return [
        own,
        *(
            _ties(chains, other, [time_ns], [place], [sd_m], dof)
            for other, time_ns, place, sd_m in zip(
                others, times_ns, places, own.sd_m.tolist(), strict=True
            )
        ),
    ]


def _ties(
    chains: list[Chain], chain: int, times_ns: list[int], places: list[PlaceId],
    sds_m: list[float], dof: float,
) -> Ties:  # fmt: skip
    """Return one chain's ties, each for itself."""
    count, time_ns = len(times_ns), np.array(times_ns, np.int64)
    return Ties(
        np.full(count, chain), time_ns, *chains[chain].nearest_each(time_ns), places,
        np.array(sds_m, np.float64), np.full(count, dof), np.ones(count),
    )  # fmt: skip


def _passes(heard: ResponderLog, until_ns: int, settings: TeamSettings) -> list[Peak]:
    """Return the peaks sharp enough; of a DAP that tells none, the strongest of each stay.

    The faint ones are returned of who was never tied to anything by those.
    """
    told = {peak.other_id for peak in heard.peaks}
    passes = _as_loud(heard.peaks, until_ns, settings.sharpness.least_dbm)
    if not passes and all(start.tied_ns is None for start in heard.starts):
        passes = _as_loud(heard.peaks, until_ns, settings.sharpness.faint_dbm)
    stays: dict[str, Peak] = {}
    for near in heard.nears:
        if near.time_ns > until_ns or near.other_id in told:
            continue
        best = stays.get(near.other_id)
        if best is not None and near.time_ns - best.time_ns < SAME_PASS_S * NS_PER_S:
            if near.peak_dbm > best.peak_dbm:
                stays[near.other_id] = near
            continue
        if best is not None:
            passes.append(best)
        stays[near.other_id] = near
    return sorted([*passes, *stays.values()])


def _as_loud(peaks: list[Peak], until_ns: int, least_dbm: float) -> list[Peak]:
    return [each for each in peaks if each.time_ns <= until_ns and each.peak_dbm >= least_dbm]


def _meetings(contacts: list[Peak], until_ns: int, settings: TeamSettings) -> list[Peak]:
    """Return the contacts close enough, one for each meeting: both units may tell of it."""
    found: dict[str, Peak] = {}
    meetings = []
    for contact in contacts:
        if contact.time_ns > until_ns or contact.peak_dbm < settings.contact_least_dbm:
            continue
        last = found.get(contact.other_id)
        if last and contact.time_ns - last.time_ns < settings.contact_again_s * NS_PER_S:
            continue
        found[contact.other_id] = contact
        meetings.append(contact)
    return meetings
